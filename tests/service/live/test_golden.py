"""An engine that does not give what its model gave when it was registered is not taken into service."""

import shutil
from pathlib import Path
from typing import Any

import pytest

from cylinder_friction.deployment.golden_trajectory import GOLDEN_FILE, GoldenError
from cylinder_friction.recordings.files import write_json
from cylinder_friction.service.live.engine import Engine, checked_engine
from cylinder_friction.service.live.engine_building import engine_of, other_engines


@pytest.fixture
def registered(model: Path, tmp_path: Path) -> Path:
    """An estimator's folder in a registered model's."""
    return shutil.copytree(model, tmp_path / "registered/hybrid")


def test_the_trajectory_beside_the_estimator_must_be_met(
    registered: Path, golden: dict[str, Any], tmp_path: Path
) -> None:
    path, engines = registered.with_name(GOLDEN_FILE), tmp_path / "engines"
    folder = engine_of(registered, engines)
    assert checked_engine(folder).golden_difference_n is None
    write_json(path, golden)
    assert engine_of(registered, engines) == folder
    assert checked_engine(folder).golden_difference_n == 0.0
    golden["newtons"][200][0] += 1.0
    write_json(path, golden)
    with pytest.raises(GoldenError, match=r"model [0-9a-f]{12}: on its golden trajectory it is 1 N from what was rec"):
        engine_of(registered, engines)
    assert checked_engine(folder).golden_difference_n == 0.0  # that of the model in service stays


def test_a_registered_model_without_its_trajectory_is_refused(registered: Path, tmp_path: Path) -> None:
    with pytest.raises(GoldenError, match=r"models:/friction/3: its golden trajectory, golden\.json, is not there"):
        engine_of(registered, tmp_path / "engines", "models:/friction/3")


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"samples": [[0.0, 0.0]] * 300}, r"has columns \(2,\); expected \['pressure_1_pa'"),
        ({"flags": [0, 0]}, r"cannot be read \(ValueError"),
        ({"newtons": None}, r"cannot be read \(TypeError.*golden.json\); it gives no newtons: register it again, or n"),
    ],
)
def test_what_is_no_trajectory_of_the_model_is_refused(
    registered: Path, golden: dict[str, Any], tmp_path: Path, changed: dict[str, Any], words: str
) -> None:
    write_json(registered.with_name(GOLDEN_FILE), golden | changed)
    with pytest.raises(GoldenError, match=words):
        engine_of(registered, tmp_path / "engines")


def test_a_former_model_that_is_not_what_it_was_is_left_out(
    registered: Path, golden: dict[str, Any], tmp_path: Path, engine: Engine, caplog: pytest.LogCaptureFixture
) -> None:
    write_json(registered.with_name(GOLDEN_FILE), golden)
    folder = engine_of(registered, tmp_path / "engines")
    golden["flags"][7] ^= 1
    write_json(folder / GOLDEN_FILE, golden)
    assert other_engines(tmp_path / "engines", engine) == []
    assert "1 flags differ" in caplog.text
    assert "sessions that ran it begin anew" in caplog.text
