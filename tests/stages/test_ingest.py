from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.commands.params import compose_params
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.params.checking import Params, check_params
from cylinder_friction.params.file import ParamsError
from cylinder_friction.recordings.recording import Recording, RecordingError
from cylinder_friction.recordings.storage import read_stored
from cylinder_friction.stages import ingest
from cylinder_friction.stages._stage import RECORDINGS_FOLDER
from shipped_params import shipped

CONF = Path(__file__).parents[2] / "conf"


def own(*changes: str) -> Params:
    return check_params(compose_params(CONF, ["ingest=own", *changes]), "own")


@pytest.fixture
def workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_own_logs_as_the_example_says(
    workplace: Path, cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    recording = labelled_recordings[0]
    log = pd.DataFrame(
        {
            "t [ms]": recording.column("time_s") * 1e3,
            "p_A [bar]": recording.column("pressure_1_pa") / 1e5,
            "p_B [bar]": recording.column("pressure_2_pa") / 1e5,
            "s [mm]": recording.column("position_m") * 1e3,
        }
    )
    path = workplace / "data/raw/own/no-load_2026-03-14_monday/stroke_07.csv"
    path.parent.mkdir(parents=True)
    log.to_csv(path, index=False, sep=";", decimal=",")
    ingest.run(own())
    (read,) = read_stored(RECORDINGS_FOLDER)
    assert (read.metadata.condition, read.metadata.session) == ("no-load", "no-load_2026-03-14_monday")
    assert read.name == "no-load_2026-03-14_monday-stroke_07"
    assert read.metadata.cylinder == cylinder.name
    np.testing.assert_allclose(read.samples(), recording.samples(), rtol=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"channels": {"time_s": {"channel": "t", "unit": "s"}}}, "'pressure_1_pa' has no channel"),
        ({"name_pattern": "(?P<condition>a)"}, "has no group 'session'"),
        ({"csv": {"delimiter": ";;"}}, "csv: delimiter: expected one character, 'whitespace' or 'auto', but got ';;'"),
        ({"checks": {"least_travel": 2.0}}, "checks: least_travel: expected at least 0 and less than 1, but got 2.0"),
    ],
)
def test_impossible_settings_are_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ParamsError, match=message):
        shipped(ingest=change)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            ["ingest.load=measured"],
            "ingest.load is measured, but ingest.channels has no 'load_force_n'; map the load cell",
        ),
        (
            ["+ingest.channels.load_force_n={channel: F, unit: kN}"],
            "ingest.load is none, but ingest.channels maps a load cell",
        ),
        (
            ["ingest.oil_temperature=input"],
            "ingest.oil_temperature is input, but ingest.channels has no 'oil_temperature_c'; map the oil's",
        ),
    ],
)
def test_mapping_that_contradicts_load_or_temperature_is_refused_before_any_file(
    workplace: Path, changes: list[str], message: str
) -> None:
    with pytest.raises(RecordingError, match=message):
        ingest.run(own(*changes))
