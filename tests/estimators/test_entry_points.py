"""Estimators of another package: found by its entry points, named when they are not."""

import importlib
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import cylinder_friction as cf
from cylinder_friction.commands import code
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.baselines import baselines
from cylinder_friction.recordings.recording import Recording

KIND = "mean_of_the_label"
MODULE = """
import numpy as np

from cylinder_friction.estimators.base import FrictionEstimator


class MeanEstimator(FrictionEstimator):
    kind = "mean_of_the_label"

    def __init__(self, cylinder=None):
        super().__init__()
        self.mean_n = 0.0

    def fit(self, recordings):
        self._begin_fit(recordings)
        self.mean_n = float(np.mean([each.column("friction_n")[each.usable()].mean() for each in recordings]))
        return self

    def new_state(self):
        return None

    def advance(self, state, samples):
        return np.full(len(samples), self.mean_n)

    def multiply_adds(self):
        return 0

    def _write(self, folder):
        return {"mean_n": self.mean_n}

    @classmethod
    def _read(cls, folder, parameters):
        estimator = cls()
        estimator.mean_n = parameters["mean_n"]
        return estimator
"""


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder on the path with a module of its own; what it registers is forgotten afterwards."""
    monkeypatch.setattr(FrictionEstimator, "_kinds", dict(FrictionEstimator._kinds))
    folder = tmp_path / "site"
    folder.mkdir()
    (folder / "my_friction.py").write_text(MODULE, encoding="utf-8")
    monkeypatch.syspath_prepend(folder)
    yield folder
    sys.modules.pop("my_friction", None)


def register(folder: Path, entry: str = f"{KIND} = my_friction:MeanEstimator") -> None:
    """Register as an installed package does."""
    described = folder / "my_friction-1.0.dist-info"
    described.mkdir()
    (described / "METADATA").write_text("Metadata-Version: 2.1\nName: my-friction\nVersion: 1.0\n", encoding="utf-8")
    (described / "entry_points.txt").write_text(f"[cylinder_friction.estimators]\n{entry}\n", encoding="utf-8")
    importlib.invalidate_caches()


def forget(monkeypatch: pytest.MonkeyPatch) -> None:
    """Be a process that has not imported the module."""
    sys.modules.pop("my_friction", None)
    known = {name: each for name, each in FrictionEstimator._kinds.items() if name != KIND}
    monkeypatch.setattr(FrictionEstimator, "_kinds", known)


def test_a_registered_estimator_is_loaded_and_is_a_baseline(
    package: Path, monkeypatch: pytest.MonkeyPatch, labelled_recordings: list[Recording], tmp_path: Path
) -> None:
    register(package)
    cylinder = cf.Cylinder(bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0)
    fitted = baselines(cylinder)[KIND].fit(labelled_recordings)
    fitted.save(tmp_path / "saved")
    forget(monkeypatch)
    loaded = cf.load(tmp_path / "saved")
    np.testing.assert_array_equal(loaded.estimate(labelled_recordings[0]), fitted.estimate(labelled_recordings[0]))
    compared = cf.compare({"mine": loaded}, labelled_recordings[:1])
    assert compared.estimators == ("mine",)


def test_an_unknown_kind_names_the_module_to_import(
    package: Path, monkeypatch: pytest.MonkeyPatch, labelled_recordings: list[Recording], tmp_path: Path
) -> None:
    module = importlib.import_module("my_friction")
    module.MeanEstimator().fit(labelled_recordings).save(tmp_path / "saved")
    forget(monkeypatch)
    with pytest.raises(
        ValueError,
        match=f"kind is '{KIND}', but expected one of .*; it is my_friction.MeanEstimator: import that module first; "
        "a package can register its kinds as entry points of the group cylinder_friction.estimators",
    ):
        cf.load(tmp_path / "saved")
    importlib.import_module("my_friction")
    assert cf.load(tmp_path / "saved").kind == KIND


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ("other = my_friction:MeanEstimator", r"the kind of the class is 'mean_of_the_label'; expected the entry"),
        (f"{KIND} = my_friction:Gone", r"no attribute 'Gone'; correct it, or uninstall its package"),
        (f"{KIND} = not_there_at_all:Gone", r"No module named 'not_there_at_all'; correct it"),
        ("ridge = my_friction:MeanEstimator", r"its kind 'ridge' is the name of a baseline; choose another"),
    ],
)
def test_a_wrong_entry_point_is_named(package: Path, cylinder: cf.Cylinder, entry: str, words: str) -> None:
    register(package, entry)
    with pytest.raises(ValueError, match=words):
        baselines(cylinder)


def test_a_kind_of_this_package_is_not_taken(package: Path) -> None:
    (package / "my_friction.py").write_text(MODULE.replace(KIND, "hybrid"), encoding="utf-8")
    importlib.import_module("cylinder_friction.estimators.hybrid")
    with pytest.raises(ValueError, match="MeanEstimator: its kind 'hybrid' is that of HybridEstimator; choose another"):
        importlib.import_module("my_friction")


def test_dvc_runs_the_stages_again_after_a_change_of_such_an_estimator(
    package: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(code, "code_key", lambda stage: stage)

    def codes() -> dict[str, str]:
        code.write_code(tmp_path)
        lines = (tmp_path / "code.yaml").read_text(encoding="utf-8").splitlines()
        return dict(line.split(": ", 1) for line in lines if not line.startswith(("#", " ")))

    without = codes()
    register(package)
    before = codes()
    (package / "my_friction.py").write_text(MODULE + "# changed\n", encoding="utf-8")
    after = codes()
    assert {name for name in without if before[name] != without[name]} == {"baselines", "compare"}
    assert {name for name in without if after[name] != before[name]} == {"baselines", "compare"}
