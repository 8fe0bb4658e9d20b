"""A log too long for memory becomes parts: recordings of its session that hold every row once."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.recordings.conversion import Quarantined, recordings_of
from cylinder_friction.recordings.logs import Logs, NameRules, Recipe
from cylinder_friction.recordings.recording import Recording, RecordingError
from logger_files import CHANNELS, made_log

ROWS, PART = 60_000, 15_000


def recipe(cylinder: Cylinder, **more: Any) -> Recipe:
    channels = CHANNELS | more.pop("channels", {})
    return Recipe.from_settings({"channels": channels, **more}, NameRules(), cylinder, "none")


def outcomes(path: Path, rules: Recipe, rows: int | None = PART) -> list[Recording | Quarantined]:
    return list(recordings_of(Logs(path.parent, {path.name: path}, rules), rows))


def parts_of(path: Path, rules: Recipe, rows: int | None = PART) -> list[Recording]:
    found = outcomes(path, rules, rows)
    assert not [each for each in found if isinstance(each, Quarantined)]
    return [each for each in found if isinstance(each, Recording)]


def joined(recordings: list[Recording]) -> pd.DataFrame:
    return pd.concat([each.table for each in recordings], ignore_index=True)


@pytest.mark.parametrize("suffix", [".csv", ".csv.gz", ".parquet"])
def test_parts_hold_every_row_once(tmp_path: Path, cylinder: Cylinder, suffix: str) -> None:
    log, path = made_log(ROWS), tmp_path / f"log{suffix}"
    log.to_parquet(path, row_group_size=7_000) if suffix == ".parquet" else log.to_csv(path, index=False)
    (whole,), parts = parts_of(path, recipe(cylinder), None), parts_of(path, recipe(cylinder))
    assert [each.name for each in parts] == [f"{whole.name}_part{number:02d}" for number in (1, 2, 3, 4)]
    assert {(each.metadata.session, each.sample_time_s) for each in parts} == {(whole.name, whole.sample_time_s)}
    pd.testing.assert_frame_equal(joined(parts), whole.table)


def test_a_stated_rate_runs_on_from_part_to_part(tmp_path: Path, cylinder: Cylinder) -> None:
    made_log(ROWS).drop(columns="t").to_csv(tmp_path / "log.csv", index=False)
    parts = parts_of(tmp_path / "log.csv", recipe(cylinder, channels={"time_s": {"rate_hz": 200.0}}))
    np.testing.assert_allclose(joined(parts)["time_s"], np.arange(ROWS) / 200.0)


def test_the_first_part_decides_the_rate_of_all(tmp_path: Path, cylinder: Cylinder) -> None:
    log = made_log(ROWS)
    log.loc[PART:, "t"] = log["t"].iloc[PART] + (log["t"].iloc[PART:] - log["t"].iloc[PART]) / 2.0
    log.to_csv(tmp_path / "log.csv", index=False)
    assert {each.sample_time_s for each in parts_of(tmp_path / "log.csv", recipe(cylinder))} == {0.005}


def test_behind_a_restart_of_the_clock_no_start_is_stated(tmp_path: Path, cylinder: Cylinder) -> None:
    log = made_log(ROWS)
    log.loc[log.index >= 40_000, "t"] -= 150.0
    header = "Starttime of export,134190764950000000,fredag\n\n"
    (tmp_path / "log.csv").write_text(header + log.to_csv(index=False))
    starts = [bool(each.metadata.start) for each in parts_of(tmp_path / "log.csv", recipe(cylinder))]
    assert starts == sorted(starts, reverse=True)
    assert starts.count(True) in (3, 4)
    assert starts.count(False) == 2


Change = Callable[[list[str]], list[str]]


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda lines: [*lines[:55_000], "1,2,3\n", *lines[55_000:]], "line 55001 holds 3 instead of 4 values: '1,2"),
        (lambda lines: [*lines[:20_000], "1,broken,2,3\n", *lines[20_001:]], r"in the part of rows 1\d+ to 3\d+, "),
    ],
    ids=["no table any more", "text in a cell"],
)
def test_a_damaged_part_is_named_and_others_used(
    tmp_path: Path, cylinder: Cylinder, change: Change, reason: str
) -> None:
    made_log(ROWS).to_csv(tmp_path / "log.csv", index=False)
    lines = (tmp_path / "log.csv").read_text().splitlines(keepends=True)
    (tmp_path / "log.csv").write_text("".join(change(lines)))
    found = outcomes(tmp_path / "log.csv", recipe(cylinder))
    (refused,) = [each for each in found if isinstance(each, Quarantined)]
    assert len(found) == 4
    with pytest.raises(RecordingError, match=reason):
        raise RecordingError(refused.reason)


def test_newest_first_is_refused_if_long_and_turned_round_if_short(tmp_path: Path, cylinder: Cylinder) -> None:
    made_log(ROWS)[::-1].to_csv(tmp_path / "log.csv", index=False)
    refused = outcomes(tmp_path / "log.csv", recipe(cylinder))
    words = "if a log too long to be read at once has its newest row first, sort it by time"
    assert all(isinstance(each, Quarantined) and each.reason.endswith(words) for each in refused)
    (whole,) = parts_of(tmp_path / "log.csv", recipe(cylinder), None)
    assert len(whole) == ROWS


def test_many_time_columns_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cylinder: Cylinder) -> None:
    lines = ["t;p1;t;p2;x", *(f"{row};1.5;{row};2.5;3.5" for row in range(3_000))]
    (tmp_path / "scope.csv").write_text("\n".join([*lines, ""]))
    monkeypatch.setattr("cylinder_friction.recordings.formats.delimited.MOST_INDIVISIBLE", 10_000)
    (refused,) = outcomes(tmp_path / "scope.csv", recipe(cylinder), 1_000)
    assert isinstance(refused, Quarantined)
    assert "has columns of one name (t), which may end at rows of their own, and is then read whole" in refused.reason
