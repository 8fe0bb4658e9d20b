"""A model whose estimator is of somebody's own package: what it brings along is enough to serve it."""

from __future__ import annotations

import importlib
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from mlflow.models import Model

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.deployment.brought_code import requirements_of
from cylinder_friction.deployment.served_model import save_model_folder
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.refusal import RefusalError

FILES = {
    "boosted/__init__.py": "",
    "boosted/estimator.py": """
import iniconfig  # a package that nothing else of the model requires

from boosted.names import KIND
from cylinder_friction.estimators.linear import LowPassForceBalanceEstimator
from cylinder_friction.labelling import averages  # a module that no other served model needs


class BoostedEstimator(LowPassForceBalanceEstimator):
    kind = KIND
    used = (iniconfig.IniConfig, averages)
""",
    "boosted/names.py": 'KIND = "boosted"\n',
    "boosted_friction-0.1.dist-info/entry_points.txt": (
        "[cylinder_friction.estimators]\nboosted = boosted.estimator:BoostedEstimator\n"
    ),
    "boosted_friction-0.1.dist-info/METADATA": (
        "Metadata-Version: 2.1\nName: boosted-friction\nVersion: 0.1\nRequires-Dist: iniconfig>=2\n"
        "Requires-Dist: cylinder-friction\nRequires-Dist: colorama; sys_platform == 'win32'\n"
    ),
}
"""An installed package: its modules, and what its pyproject.toml states."""


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder on the path in which the package is installed; it is forgotten afterwards."""
    monkeypatch.setattr(FrictionEstimator, "_kinds", dict(FrictionEstimator._kinds))
    folder = tmp_path / "site"
    for name, text in FILES.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
    monkeypatch.syspath_prepend(folder)
    importlib.invalidate_caches()
    yield folder
    for name in [name for name in sys.modules if name.partition(".")[0] == "boosted"]:
        del sys.modules[name]


@pytest.fixture
def model(site: Path, cylinder: Cylinder, labelled_recordings: list[Recording], tmp_path: Path) -> Path:
    """The folder of the logged model; its example are 400 rows."""
    found = importlib.import_module("boosted.estimator").BoostedEstimator(cylinder)
    found.fit(labelled_recordings).save(tmp_path / "boosted")
    rows = pd.DataFrame(labelled_recordings[0].samples()[:400], columns=list(SAMPLE_COLUMNS))
    folder = tmp_path / "logged/model"
    folder.parent.mkdir()
    save_model_folder(folder, tmp_path / "boosted", {}, rows, Model())
    return folder


def predicted(model: Path, python: Path, cache: Path) -> np.ndarray:
    """Let MLflow's own command predict, in a process that has neither of the two packages on its path."""
    given = {**os.environ, "XDG_CACHE_HOME": str(cache)}
    for name in ("PYTHONPATH", "NUMBA_CACHE_DIR"):
        given.pop(name, None)
    example = model / "serving_input_example.json"
    asked = [str(python), "-m", "mlflow", "models", "predict", "-m", str(model), "-i", str(example)]
    asked += ["--env-manager", "local", "-o", str(cache / "out.json")]
    cache.mkdir(exist_ok=True)
    done = subprocess.run(asked, env=given, cwd=cache, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    rows = json.loads((cache / "out.json").read_text(encoding="utf-8"))["predictions"]
    return np.array([row["friction_n"] for row in rows])


def expected_n(model: Path) -> np.ndarray:
    """Estimate the example's rows here."""
    (folder,) = (model / "artifacts").glob("*/estimator.json")
    example = json.loads((model / "serving_input_example.json").read_text(encoding="utf-8"))
    samples = np.array(example["dataframe_split"]["data"])
    stream = FrictionEstimator.load(folder.parent).stream()
    return np.array([stream.step(*row) for row in samples])


def test_a_model_brings_its_estimators_package_and_states_what_that_requires(model: Path, tmp_path: Path) -> None:
    requirements = (model / "requirements.txt").read_text(encoding="utf-8").split()
    named = [each.partition("==")[0] for each in requirements]
    assert f"iniconfig=={importlib.metadata.version('iniconfig')}" in requirements
    assert not {"boosted-friction", "cylinder-friction", "colorama"} & {*named}
    assert (model / "code/boosted/names.py").is_file()
    assert (model / "code/cylinder_friction/labelling/averages.py").is_file()
    got = predicted(model, Path(sys.executable), tmp_path / "cache")
    np.testing.assert_allclose(got, expected_n(model), rtol=0.0, atol=1e-9)


@pytest.mark.extended
def test_it_is_served_in_an_environment_of_its_requirements_alone(model: Path, tmp_path: Path) -> None:
    fresh = tmp_path / "fresh"
    subprocess.run([sys.executable, "-m", "venv", str(fresh)], check=True)
    install = [str(fresh / "bin/python"), "-m", "pip", "install", "--quiet", "-r"]
    subprocess.run([*install, str(model / "requirements.txt")], check=True)
    got = predicted(model, fresh / "bin/python", tmp_path / "cache")
    np.testing.assert_allclose(got, expected_n(model), rtol=0.0, atol=1e-9)


@pytest.mark.parametrize(
    ("requires", "direct", "words"),
    [
        ("nobody-has-this", False, "requires 'nobody-has-this', which is not installed; install it"),
        ("boosted-tools>=1", True, "put its modules into the estimator's package, or install it"),
    ],
)
def test_what_a_server_cannot_install_is_refused(site: Path, requires: str, direct: bool, words: str) -> None:
    with (site / "boosted_friction-0.1.dist-info/METADATA").open("a", encoding="utf-8") as file:
        file.write(f"Requires-Dist: {requires}\n")
    if direct:
        tools = site / "boosted_tools-1.0.dist-info"
        tools.mkdir()
        described = "Metadata-Version: 2.1\nName: boosted-tools\nVersion: 1.0\n"
        (tools / "METADATA").write_text(described, encoding="utf-8")
        (tools / "direct_url.json").write_text('{"url": "file:///home/me/tools"}', encoding="utf-8")
    with pytest.raises(RefusalError) as refused:
        requirements_of("boosted")
    assert words in str(refused.value)
