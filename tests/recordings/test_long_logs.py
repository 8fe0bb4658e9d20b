"""A log that is processed in parts becomes what the same log becomes as a whole, wherever it is cut."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.recordings.conversion import Recipe, pieces_of
from cylinder_friction.recordings.ingesting import Quarantined, convert_in_parts
from cylinder_friction.recordings.long_logs import LongRecording, pieces_or_drafts
from cylinder_friction.recordings.path_names import NameRules
from cylinder_friction.recordings.recording import RecordingError, RecordingPiece
from cylinder_friction.recordings.storage import read_recording
from logger_files import CHANNELS, made_log

ROWS = 60_000
DELAYED = {"range": [0.0, 250.0], "unit": "mm", "delay_s": 0.012}
EXACT, BRIDGED, SAME_GRID = 0.0, 1e-12, 1e-9
"""Greatest difference between parts and whole, as a share of a column's largest value."""


def lost(log: pd.DataFrame) -> pd.DataFrame:
    """Lose single rows, two in a row, and cells."""
    log.loc[log.index[777::5003], "p1"] = np.nan
    return log.drop(index=[*range(2000, ROWS, 4999), *range(2001, ROWS, 4999)])


def split(log: pd.DataFrame) -> pd.DataFrame:
    """Lose half a minute twice."""
    return log.drop(index=[*range(20_000, 26_000), *range(40_000, 40_500)])


def restarted(log: pd.DataFrame) -> pd.DataFrame:
    log.loc[log.index >= 31_234, "t"] -= 150.0
    return log


def shuffled(log: pd.DataFrame) -> pd.DataFrame:
    """Swap neighbours, double rows, and damage single stamps."""
    order = np.arange(ROWS)
    order[999::7001], order[1000::7001] = order[1000::7001].copy(), order[999::7001].copy()
    log = log.iloc[order].reset_index(drop=True)
    log.loc[log.index[3500::9001], "t"] = 1e9
    return log.loc[log.index.repeat(np.where(np.arange(ROWS) % 6007 == 5, 2, 1))]


def spiky(log: pd.DataFrame) -> pd.DataFrame:
    log.loc[log.index[1500::11_003], "p2"] += 200.0
    return log


def uneven(log: pd.DataFrame) -> pd.DataFrame:
    log["t"] += np.random.default_rng(2).uniform(0.0, 0.0015, len(log))
    return log


def dated(log: pd.DataFrame) -> pd.DataFrame:
    log["t"] = (pd.Timestamp("2026-03-01 23:58") + pd.to_timedelta(log["t"], unit="s")).dt.strftime(
        "%Y-%m-%d %H:%M:%S.%f"
    )
    return log


def warm(log: pd.DataFrame) -> pd.DataFrame:
    """Log the oil's temperature once a second in the same table."""
    log["oil"] = np.where(np.arange(ROWS) % 200 == 0, np.round(40.0 + 5.0 * np.sin(0.01 * log["t"]), 2), np.nan)
    return log


def coarse(log: pd.DataFrame) -> pd.DataFrame:
    """Log time with a clock that ticks every 50 ms."""
    return log.assign(t=np.floor(log["t"] / 0.05) * 0.05)


def two_clocks(log: pd.DataFrame) -> pd.DataFrame:
    return log.assign(t2=log["t"] + 0.001)


def recipe(cylinder: Cylinder, **more: Any) -> Recipe:
    channels = CHANNELS | more.pop("channels", {})
    return Recipe.from_settings({"channels": channels, **more}, NameRules(condition="1"), cylinder, "none")


def written(path: Path, change: Callable[[pd.DataFrame], pd.DataFrame]) -> Path:
    change(made_log(ROWS)).to_csv(path, index=False)
    return path


@pytest.mark.extended
@pytest.mark.parametrize(
    ("change", "more", "tolerance"),
    [
        (pd.DataFrame.copy, {}, EXACT),
        (lost, {}, BRIDGED),
        (split, {}, EXACT),
        (restarted, {}, EXACT),
        (shuffled, {}, BRIDGED),
        (spiky, {}, BRIDGED),
        (dated, {}, EXACT),
        (pd.DataFrame.copy, {"time": {"rate_hz": 250.0}}, SAME_GRID),
        (split, {"time": {"rate_hz": 100.0}}, SAME_GRID),
        (restarted, {"time": {"rate_hz": 80.0}}, SAME_GRID),
        (uneven, {}, SAME_GRID),
        (pd.DataFrame.copy, {"channels": {"time_s": {"rate_hz": 200.0}}}, EXACT),
        (pd.DataFrame.copy, {"channels": {"position_m": CHANNELS["position_m"] | {"sensor": DELAYED}}}, SAME_GRID),
        (warm, {"channels": {"oil_temperature_c": {"channel": "oil", "unit": "degC"}}}, SAME_GRID),
    ],
)
@pytest.mark.parametrize("rows", [3_000, 17_001])
def test_parts_are_what_the_whole_is(
    tmp_path: Path,
    cylinder: Cylinder,
    change: Callable[[pd.DataFrame], pd.DataFrame],
    more: dict[str, Any],
    tolerance: float,
    rows: int,
) -> None:
    path, rules = written(tmp_path / "log.csv", change), recipe(cylinder, **more)
    whole = pieces_of(path, rules)
    drafts = pieces_or_drafts(path, rules, rows=rows, folder=tmp_path / "parts")
    assert len(drafts) == len(whole)
    for draft, piece in zip(drafts, whole, strict=True):
        recording = LongRecording(read_recording(draft.paths[0]).metadata, tuple(draft.paths), tuple(draft.own))
        (joined,) = recording.excerpt()
        assert recording.metadata.sample_time_s == piece.sample_time_s
        assert len(joined) == len(piece.columns["time_s"])
        for column in piece.columns:
            expected = piece.columns[column]
            np.testing.assert_allclose(
                joined.column(str(column)), expected, rtol=0.0, atol=tolerance * np.abs(expected).max()
            )
    assert max(len(draft.paths) for draft in drafts) > 1


def test_what_is_found_in_single_samples_counts_for_the_file(tmp_path: Path, cylinder: Cylinder) -> None:
    path, rules = written(tmp_path / "log.csv", spiky), recipe(cylinder)
    (whole,) = pieces_of(path, rules)
    (parts,) = convert_in_parts({"log.csv": path}, rules, tmp_path / "parts", 5_000)
    assert isinstance(parts, LongRecording)
    assert "pressure_2_pa is" in whole.repairs[0]
    assert "(6 such rows in all), a spike" in whole.repairs[0]
    assert whole.repairs[0] in parts.metadata.repairs


def test_many_time_columns_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cylinder: Cylinder) -> None:
    lines = ["t;p1;t;p2;x", *(f"{row};1.5;{row};2.5;3.5" for row in range(3_000))]
    (tmp_path / "scope.csv").write_text("\n".join([*lines, ""]))
    monkeypatch.setattr("cylinder_friction.recordings.formats.delimited.MOST_INDIVISIBLE", 10_000)
    with pytest.raises(RecordingError, match=r"its columns of one name \(t\) end at rows of their own"):
        pieces_or_drafts(tmp_path / "scope.csv", recipe(cylinder), rows=1_000, folder=tmp_path / "parts")


@pytest.mark.parametrize("suffix", [".csv.gz", ".parquet", ".csv"])
def test_other_files_are_read_in_parts_too(tmp_path: Path, cylinder: Cylinder, suffix: str) -> None:
    log = made_log(ROWS)
    path = tmp_path / f"log{suffix}"
    if suffix == ".parquet":
        log.to_parquet(path, row_group_size=7_000)
    else:
        log.assign(**{"µ [°]": 1.0}).to_csv(path, index=False, encoding="cp1252")
    (whole,) = pieces_of(path, recipe(cylinder))
    (draft,) = pieces_or_drafts(path, recipe(cylinder), rows=5_000, folder=tmp_path / "parts")
    (joined,) = LongRecording(read_recording(draft.paths[0]).metadata, tuple(draft.paths), tuple(draft.own)).excerpt()
    pd.testing.assert_frame_equal(joined.table, pd.DataFrame(whole.columns))


def refusal(path: Path, cylinder: Cylinder, folder: Path) -> str:
    (outcome,) = convert_in_parts({path.name: path}, recipe(cylinder), folder, 5_000)
    assert isinstance(outcome, Quarantined)
    return outcome.reason


def test_what_is_wrong_far_down_is_named(tmp_path: Path, cylinder: Cylinder) -> None:
    path = written(tmp_path / "log.csv", pd.DataFrame.copy)
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join([*lines[:55_000], "1,2,3\n", *lines[55_000:]]))
    assert refusal(path, cylinder, tmp_path / "parts").startswith("line 55001 holds 3 values: '1,2,3'; expected 4")
    path.write_text("".join([*lines[:55_000], lines[55_000].split(",")[0] + ",broken,2,3\n", *lines[55_001:]]))
    reason = refusal(path, cylinder, tmp_path / "parts")
    assert "below row " in reason
    assert "from which rows count here: channel 'p1' (for 'pressure_1_pa') holds 'broken' in row " in reason


def test_checks_are_those_of_the_whole(tmp_path: Path, cylinder: Cylinder) -> None:
    def resting(log: pd.DataFrame) -> pd.DataFrame:
        return log.assign(x=log["x"].where(log.index > 30_000, log["x"].iloc[30_000] + 1e-3 * (log.index % 7)))

    def far(log: pd.DataFrame) -> pd.DataFrame:
        return log.assign(x=log["x"] + 200.0 * np.clip((log.index - 50_000) / 4000.0, 0.0, 1.0))

    path = written(tmp_path / "rest.csv", resting)
    (recording,) = convert_in_parts({"rest.csv": path}, recipe(cylinder), tmp_path / "parts", 5_000)
    assert isinstance(recording, LongRecording)
    reason = refusal(written(tmp_path / "far.csv", far), cylinder, tmp_path / "parts")
    assert reason.startswith("in the part that begins at ")
    assert "expected 0 to 0.25 m, the stroke" in reason


@pytest.mark.parametrize(
    ("change", "channels", "why"),
    [
        (coarse, {}, "time increases nowhere without a gap over 128 rows"),
        (two_clocks, {"position_m": CHANNELS["position_m"] | {"time": "t2"}}, "channels with clocks of their own"),
    ],
)
def test_a_log_that_cannot_be_cut_is_read_whole_up_to_a_size(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    cylinder: Cylinder,
    change: Callable[[pd.DataFrame], pd.DataFrame],
    channels: dict[str, Any],
    why: str,
) -> None:
    path, rules = written(tmp_path / "log.csv", change), recipe(cylinder, channels=channels)
    (piece,) = pieces_or_drafts(path, rules, rows=1_000, folder=tmp_path / "parts")
    assert isinstance(piece, RecordingPiece)
    monkeypatch.setattr("cylinder_friction.recordings.long_logs.MOST_INDIVISIBLE", 1_000_000)
    with pytest.raises(RecordingError, match=rf"MB, at most 1 MB\), and cannot be processed in parts: .*{why}"):
        pieces_or_drafts(path, rules, rows=1_000, folder=tmp_path / "parts")
