"""Stage ``lugre``: each estimator is identified on the recordings that are its own."""

import json
import shutil
from pathlib import Path

import pandas as pd
import pytest

from cylinder_friction.estimators.analytical import AnalyticalEstimator
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.files.whole_files import hash_of
from cylinder_friction.params.checking import Params
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.recordings.storage import write_recording
from cylinder_friction.run_record import RunRecord
from cylinder_friction.stages import lugre
from cylinder_friction.stages._stage import LUGRE_FOLDER
from shipped_params import shipped


def tiny_params(condition: str = "1") -> Params:
    effort = {"population": 2, "generations": 2, "simulated_recordings": 1}
    return shipped(lugre={"condition": condition, "velocity_dead_band_m_s": 6e-4, **effort})


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory, labelled_recordings: list[Recording]) -> tuple[Path, RunRecord]:
    """A folder in which the stage has run once, and its record; read only."""
    folder = tmp_path_factory.mktemp("lugre")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for recording in labelled_recordings[:3]:
            write_recording(Path("data/processed/train"), recording)
        return folder, lugre.run(tiny_params())


def test_the_stage_leaves_every_estimator_and_the_points(
    finished: tuple[Path, RunRecord], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, record = finished
    monkeypatch.chdir(folder)
    parameters = pd.DataFrame(record.tables["parameters"]).set_index(["estimator", "parameter"])
    for name, condition in (("lugre", "1"), ("pressure_lugre", "1"), ("pressure_lugre_all", None)):
        estimator = load_estimator(LUGRE_FOLDER / name)
        assert isinstance(estimator, AnalyticalEstimator)
        assert (estimator.model.name, estimator.condition) == (name.removesuffix("_all"), condition)
        assert 0.0 < record.metrics[f"train_mae_percent/{name}"] < 10.0
        found = parameters.loc[(name, "coulomb_n")]
        assert found["lower"] < found["value"] < found["upper"]
        assert len(record.curves[f"search_mae_n/{name}"]) >= 1
    points = json.loads((LUGRE_FOLDER / lugre.STRIBECK_FILE).read_text())
    assert {"velocity_m_s", "friction_n", "rows"} <= set(points["points"][0])
    assert points["curve"]["coulomb_n"] > 0.0
    assert record.name == "lugre"
    assert record.artifacts == ("models/lugre",)
    assert record.params["condition"] == "1"


@pytest.mark.extended
def test_recordings_of_other_conditions_change_what_is_identified_in_all_of_them_alone(
    finished: tuple[Path, RunRecord],
    labelled_recordings: list[Recording],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    shutil.copytree(finished[0] / "data", tmp_path / "data")
    monkeypatch.chdir(tmp_path)
    write_recording(Path("data/processed/train"), labelled_recordings[-1])
    lugre.run(tiny_params())
    names = ("lugre", "pressure_lugre", "pressure_lugre_all", lugre.STRIBECK_FILE)
    changed = {name for name in names if hash_of(LUGRE_FOLDER / name) != hash_of(finished[0] / LUGRE_FOLDER / name)}
    assert changed == {"pressure_lugre_all"}
