"""The code that a logged model brings along: run as registered, compiled once outside the model's folder."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from cylinder_friction.files.whole_files import hash_of
from cylinder_friction.import_graph import SOURCE

LOAD = """
import sys, mlflow
model = mlflow.pyfunc.load_model(sys.argv[1])
assert len(model.predict(model.input_example)) == len(model.input_example)
import cylinder_friction.deployment.scoring as used
assert not {"torch", "sklearn"} & {*sys.modules}
print(used.__file__)
"""


@pytest.fixture(scope="module")
def other_version(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with another version of the package, which has one comment more."""
    folder = tmp_path_factory.mktemp("other")
    shutil.copytree(SOURCE / "cylinder_friction", folder / "cylinder_friction")
    with (folder / "cylinder_friction/arrays.py").open("a") as file:
        file.write("# another version\n")
    return folder


def load(folder: Path, package: Path, cache: Path, code: str = LOAD) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(package), "XDG_CACHE_HOME": str(cache)}
    environment.pop("NUMBA_CACHE_DIR", None)
    command = [sys.executable, "-c", code, str(folder)]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def test_the_installed_package_is_used_if_it_is_what_the_model_was_registered_with(
    golden_folder: Path, tmp_path: Path
) -> None:
    done = load(golden_folder, SOURCE, tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == str(SOURCE / "cylinder_friction/deployment/scoring.py")
    assert not (tmp_path / "cylinder-friction").exists()


@pytest.mark.extended
def test_beside_another_version_the_models_own_code_runs_compiled_once_outside_its_folder(
    golden_folder: Path, other_version: Path, tmp_path: Path
) -> None:
    registered, files = hash_of(golden_folder), sorted(golden_folder.rglob("*"))
    moved = tmp_path / "downloaded elsewhere"
    shutil.copytree(golden_folder, moved)
    compiled = []
    for each in (golden_folder, moved, golden_folder):
        done = load(each, other_version, tmp_path / "cache")
        assert done.returncode == 0, done.stderr
        (place,) = (tmp_path / "cache/cylinder-friction").iterdir()
        assert Path(done.stdout.strip()) == place / "cylinder_friction/deployment/scoring.py"
        compiled.append({path: path.stat().st_mtime_ns for path in place.rglob("*.nb[ic]")})
        if len(compiled) == 2:  # a damaged copy is replaced
            (place / "cylinder_friction/arrays.py").write_text("raise SystemExit\n")
    assert compiled[0]
    assert compiled[1] == compiled[0], "nothing was compiled again"
    assert (hash_of(golden_folder), sorted(golden_folder.rglob("*"))) == (registered, files)


def test_a_process_that_has_imported_another_version_is_refused_by_both_names(
    golden_folder: Path, other_version: Path, tmp_path: Path
) -> None:
    done = load(golden_folder, other_version, tmp_path, f"import cylinder_friction\n{LOAD}")
    assert done.returncode == 1
    wanted = "this model brings cylinder_friction with code "
    assert wanted in done.stderr
    assert f" along, but {other_version} with code " in done.stderr
    assert "load the model in a process that has not imported cylinder_friction" in done.stderr


@pytest.mark.extended
def test_without_a_cache_that_can_be_written_it_works_and_says_what_it_costs(
    golden_folder: Path, other_version: Path, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("no folder")
    done = load(golden_folder, other_version, tmp_path / "file")
    assert done.returncode == 0, done.stderr
    assert "set XDG_CACHE_HOME to a folder that only you can write" in done.stderr


def test_a_model_that_misses_its_golden_trajectory_does_not_start(golden_folder: Path, tmp_path: Path) -> None:
    copy = tmp_path / "model"
    shutil.copytree(golden_folder, copy)
    golden = copy / "artifacts/golden.json"
    content = json.loads(golden.read_text())
    content["newtons"][400][0] += 1.0
    golden.write_text(json.dumps(content))
    done = load(copy, SOURCE, tmp_path)
    assert done.returncode == 1
    assert "on its golden trajectory it is 1 N from what was recorded with it" in done.stderr


@pytest.mark.parametrize(
    "file", ["artifacts/golden.json", "artifacts/model/network.onnx", "code/cylinder_friction/realtime/flags.py"]
)
def test_a_model_with_a_damaged_file_ends_the_server_in_one_sentence(
    file: str, golden_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    copy = tmp_path / "model"
    shutil.copytree(golden_folder, copy)
    (copy / file).write_text("damaged (")
    monkeypatch.setenv("__pyfunc_model_path__", str(copy))  # as MLflow's server sets it
    done = load(copy, SOURCE, tmp_path)
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    last = done.stderr.strip().splitlines()[-1]
    assert last.startswith(f"this model does not start, because of {copy}")
    assert Path(file).name in last
    assert "restore the file from a backup, or register the model again" in last


@pytest.mark.skipif(subprocess.run(["unshare", "-rm", "true"], check=False).returncode != 0, reason="no namespaces")
def test_a_full_cache_is_not_used_and_stays_empty(golden_folder: Path, other_version: Path, tmp_path: Path) -> None:
    code = "import runpy, sys\nfrom pathlib import Path\nmodel = Path(sys.argv[1])\n"
    code += "runpy.run_path(str(model / 'scoring_model.py'))['import_brought_code'](model / 'code')\nprint(sys.path[0])"
    (tmp_path / "cache").mkdir()
    (tmp_path / "run.py").write_text(code)
    mount = 'mount -t tmpfs -o size=64k none "$0" && XDG_CACHE_HOME="$0" "$@" && find "$0"'
    command = ["unshare", "-rm", "sh", "-c", mount, tmp_path / "cache", sys.executable, tmp_path / "run.py"]
    environment = {**os.environ, "PYTHONPATH": str(other_version)}
    done = subprocess.run([*command, golden_folder], env=environment, capture_output=True, text=True, check=False)
    assert "No space left on device" in done.stderr
    used, *left = done.stdout.splitlines()
    assert (Path(used) / "cylinder_friction/arrays.py").is_file()
    shutil.rmtree(Path(used).parent)
    assert left == [f"{tmp_path}/cache", f"{tmp_path}/cache/cylinder-friction"]
