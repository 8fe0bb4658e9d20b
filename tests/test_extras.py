"""The core works without the extras; where one is missing, the message has the command that installs it."""

import re
import subprocess
import sys
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.extras import BROUGHT_BY, MissingExtraError, explained, not_installed

PROJECT = Path(__file__).parents[1]
BLOCK = f"""
import sys
class Absent:
    def find_spec(self, name, *_):
        if name.partition(".")[0] in {sorted(BROUGHT_BY)}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Absent())
from cylinder_friction.commands.cli import main
"""
NEED_EXTRAS = (
    "commands.lineage",
    "commands.params",
    "commands.promote",
    "commands.rollback",
    "commands.serve",
    "commands.stage",
    "commands.track",
    "commands.ui",
    "deployment.mlflow_ui",
    "deployment.scoring_model",
    "deployment.served_model",
    "estimators.training",
    "execution.cluster",
    "params.composing",
    "reporting.search_figures",
    "service",
    "stages",
    "tracking",
    "tuning",
)
IMPORT_ALL = """
from importlib import import_module
from cylinder_friction.import_graph import all_modules
for module in all_modules():
    package, _, name = module.partition(".")
    if package == "cylinder_friction" and not name.startswith({}):
        import_module(module)
"""
EXTRAS = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
MAPPING = "conf/ingest/rig.yaml"
LOG = "condition1_session01_recording01.csv"


def without_extras(folder: Path, code: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", BLOCK + code], cwd=folder, capture_output=True, text=True)


@pytest.mark.extended
def test_every_module_of_the_core_imports_without_extras(tmp_path: Path) -> None:
    done = without_extras(tmp_path, IMPORT_ALL.format(NEED_EXTRAS))
    assert done.returncode == 0, done.stderr


@pytest.mark.extended
def test_the_core_goes_from_a_log_to_friction_and_to_c(tmp_path: Path, small_hybrid: HybridEstimator) -> None:
    small_hybrid.save(tmp_path / "hybrid")
    commands = [
        ["init", "project"],
        ["ingest", "init", f"project/{LOG}"],
        ["export", "c", "hybrid", "--output", "c"],
        ["export", "fmu", "hybrid", "--output", "press.fmu"],
    ]
    inside = [
        ["check"],
        ["inspect", LOG],
        ["estimate", LOG, "--channels", MAPPING],
        ["estimate", LOG, "--channels", MAPPING, "--model", "../hybrid", "--output", "real_time"],
        ["identify", LOG, "--channels", MAPPING, "--generations", "1"],
    ]
    run = "for command in {}: assert main(command) in {}, command\n"
    code = run.format(commands, {0}) + "import os; os.chdir('project')\n" + run.format(inside, {0, 1})
    done = without_extras(tmp_path, code)
    assert done.returncode == 0, done.stdout + done.stderr
    made = ("friction/friction.html", "real_time/friction.html", "friction_models", "reports/inspection.html")
    assert all((tmp_path / "project" / path).exists() for path in made), done.stdout + done.stderr
    assert {path.name for path in (tmp_path / "c").iterdir()} == {"friction.c", "friction.h"}


NEEDED = {
    "params experiment=smoke": "pipeline",
    "stage record": "pipeline",
    "lineage models:/friction-estimator/1": "pipeline",
    "serve models:/friction-estimator/1 --port 0": "serve",
    "ui": "serve",
    "track": "pipeline",
}


def test_a_command_names_the_extra_it_needs(tmp_path: Path) -> None:
    (tmp_path / "conf").mkdir()
    (tmp_path / "params.yaml").write_bytes((PROJECT / "params.yaml").read_bytes())
    done = without_extras(tmp_path, f"for command in {[*NEEDED]}: assert main(command.split()) == 1, command")
    assert done.returncode == 0, done.stderr
    starts = "which can take a minute"  # of a server
    messages = [line for line in done.stderr.splitlines() if not line.endswith(starts)]
    assert [message.rpartition("; ")[2] for message in messages] == [
        f'pip install "cylinder-friction[{extra}]"' for extra in NEEDED.values()
    ]
    assert all("which is not installed" in message for message in messages)


def test_every_library_is_brought_by_the_extra_that_is_named() -> None:
    brings = {extra: {line.split(">")[0].split("=")[0].split("[")[0] for line in EXTRAS[extra]} for extra in EXTRAS}
    brings["pipeline"] |= brings["train"] | brings["serve"]
    brought = {name: {each.replace("_", "-") for each in found} for name, found in packages_distributions().items()}
    for library, named in BROUGHT_BY.items():
        by_others = {"omegaconf": "hydra-core", "dvc_data": "dvc", "dvc_objects": "dvc"}
        for extra in named:
            assert (brought[library] | {by_others.get(library)}) & brings[extra], (library, extra)


@pytest.mark.parametrize("extra", ["pipeline", "train", "serve"])
def test_the_readmes_commands_find_what_they_need_after_make_install(extra: str) -> None:
    wanted = {re.split(r"[><=\[]", line)[0] for line in EXTRAS[extra]} - {"cylinder-friction"}
    lock = (PROJECT / "requirements.lock").read_text(encoding="utf-8")
    assert wanted - {line.split("==")[0].replace("_", "-") for line in lock.splitlines()} == set()


def test_an_extra_that_does_not_bring_the_library_is_not_named() -> None:
    with pytest.raises(MissingExtraError, match=r"cylinder-friction\[serve\]"), explained("cluster"):
        raise ModuleNotFoundError(name="mlflow.pyfunc")
    with pytest.raises(MissingExtraError, match=r"cylinder-friction\[pipeline\]"), explained("pipeline"), explained():
        raise ModuleNotFoundError(name="torch")


def test_what_is_missing_for_other_reasons_is_not_explained_away() -> None:
    with pytest.raises(ModuleNotFoundError, match="No module named 'absent'") as raised, explained():
        import absent  # type: ignore[import-not-found]  # noqa: F401
    assert not isinstance(raised.value, MissingExtraError)
    assert not_installed("x", "y") == 'x, which is not installed; pip install "cylinder-friction[y]"'
