"""The wheel by itself: built, installed outside the repository, and a project's pipeline run on it to the end."""

import os
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml

from cylinder_friction.import_graph import code_key
from cylinder_friction.run_record import STAGES
from pipeline_workspace import PROJECT, commit, environment, run

pytestmark = pytest.mark.extended
BUILD = "from hatchling.build import build_{kind}; import sys; print(build_{kind}(sys.argv[1]))"


def built(kind: str, source: Path, target: Path) -> Path:
    done = run(source, sys.executable, "-c", BUILD.format(kind=kind), str(target))
    return target / done.stdout.splitlines()[-1]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return built("wheel", PROJECT, tmp_path_factory.mktemp("dist"))


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An environment that holds the wheel, and borrows what it depends on from the one the tests run in."""
    folder = tmp_path_factory.mktemp("environment")
    run(folder, sys.executable, "-m", "venv", "--without-pip", str(folder))
    (packages,) = folder.glob("lib/python*/site-packages")
    (packages / "borrowed.pth").write_text(f"{sysconfig.get_paths()['purelib']}\n", encoding="utf-8")
    run(folder, sys.executable, "-m", "pip", "--python", str(folder), "install", "-q", "--no-deps", str(wheel))
    take_over_machine_code(packages)
    return folder


def take_over_machine_code(packages: Path) -> None:
    """Copy what Numba compiled in the checkout, so that the installed package need not compile it again.

    The files are equal. Numba recognises a file by its time and its size.
    """
    source = PROJECT / "src"
    for module in source.rglob("*.py"):
        changed_ns = module.stat().st_mtime_ns
        os.utime(packages / module.relative_to(source), ns=(changed_ns, changed_ns))
    for compiled in source.rglob("__pycache__/*.nb[ci]"):
        target = packages / compiled.relative_to(source)
        target.parent.mkdir(exist_ok=True)
        shutil.copy2(compiled, target)


@pytest.fixture(scope="module")
def call(installed: Path) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Run a command of the environment in a folder, with nothing of the repository on any path."""
    env = {key: value for key, value in environment().items() if key != "PYTHONPATH"}
    env["PATH"] = f"{installed / 'bin'}:{env['PATH']}"

    def called(folder: Path, *command: str) -> subprocess.CompletedProcess[str]:
        if command[0] == "dvc":
            command = (str(installed / "bin/python"), "-m", *command)
        done = subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True)
        assert done.returncode == 0, f"{' '.join(command)}\n{done.stdout}\n{done.stderr}"
        return done

    return called


def test_the_sdist_builds_the_same_wheel(wheel: Path, tmp_path: Path) -> None:
    sdist = built("sdist", PROJECT, tmp_path)
    with tarfile.open(sdist) as archive:
        archive.extractall(tmp_path, filter="data")
    again = built("wheel", tmp_path / sdist.name.removesuffix(".tar.gz"), tmp_path)
    with zipfile.ZipFile(wheel) as one, zipfile.ZipFile(again) as other:
        assert [(file.filename, file.CRC) for file in one.filelist] == [
            (file.filename, file.CRC) for file in other.filelist
        ]


def test_the_pipeline_runs_in_a_project_and_an_upgrade_runs_again_what_changed(
    installed: Path, call: Callable[..., subprocess.CompletedProcess[str]], tmp_path: Path
) -> None:
    project = tmp_path / "project"
    call(tmp_path, "cylinder-friction", "init", str(project))
    codes = yaml.safe_load((project / "code.yaml").read_text(encoding="utf-8"))
    assert {stage: codes[stage] for stage in STAGES} == {
        stage: code_key(f"cylinder_friction.stages.{stage}") for stage in STAGES
    }, "the wheel's code is not the checkout's"
    call(project, "cylinder-friction", "params", "experiment=smoke")
    commit(project, "project")

    call(project, "dvc", "repro")
    assert "Hybrid" in call(project, "cylinder-friction", "summary").stdout
    assert "links hold" in call(project, "cylinder-friction", "lineage").stdout
    assert call(project, "dvc", "status").stdout.split() == ["code:", "always", "changed"]

    (example,) = project.glob("mlartifacts/**/serving_input_example.json")
    served = ("-m", "models:/friction-estimator-smoke@champion", "--env-manager", "local", "-i", str(example))
    predicted = call(project, str(installed / "bin/python"), "-m", "mlflow", "models", "predict", *served)
    assert "WARMING" not in predicted.stdout[-300:]
    assert '"friction_n"' in predicted.stdout[-300:]

    (changed,) = installed.glob("lib/python*/site-packages/cylinder_friction/stages/lugre.py")
    changed.write_text(changed.read_text(encoding="utf-8") + "# another release\n", encoding="utf-8")
    call(project, "dvc", "repro", "code")
    stale = yaml.safe_load(call(project, "dvc", "status", "--json").stdout)
    assert set(stale) == {"code", "lugre"}
    assert stale["lugre"] == [{"changed deps": {"code.yaml": {"lugre": "modified"}}}]
