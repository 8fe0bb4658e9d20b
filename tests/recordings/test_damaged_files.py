"""A corpus of damaged files: each comes out as it should, says why, and never stops the good files beside it.

Every case takes a good log of the rig and damages it in one way. What is expected stands beside it: ``passes``
(nothing to say), ``repaired`` (a recording that says what was done), ``split`` (several recordings that say so) or
``quarantined``.
"""

import io
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.recordings.checks.limits import CheckLimits
from cylinder_friction.recordings.conversion import Recipe
from cylinder_friction.recordings.files import read_json
from cylinder_friction.recordings.ingesting import Source, ingest_folder
from cylinder_friction.recordings.mapping.channel_mapping import ChannelMapping
from cylinder_friction.recordings.path_names import NameRules
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.recordings.storage import read_stored
from cylinder_friction.rig.campaign import CampaignPlan, campaign

Damage = Callable[[pd.DataFrame, Path], None]

TIME, P1, P2, POSITION = "Time [s]", "P1 [bar]", "P2 [bar]", "Position [mm]"
CHANNELS = {
    "time_s": {"channel": TIME, "unit": "s"},
    "pressure_1_pa": {"channel": P1, "unit": "bar", "sensor": {"range": [0.0, 250.0], "unit": "bar", "bits": 12}},
    "pressure_2_pa": {"channel": P2, "unit": "bar", "sensor": {"range": [0.0, 250.0], "unit": "bar", "bits": 12}},
    "position_m": {"channel": POSITION, "unit": "mm"},
}
DAMAGED = "condition1_session09_recording01"


def csv(table: pd.DataFrame, **options: object) -> str:
    return str(table.to_csv(index=False, float_format="%.3f", lineterminator="\n", **options))


def text(change: Callable[[str], str | bytes], ending: str = "csv") -> Damage:
    """Damages the text of the CSV file."""

    def write(table: pd.DataFrame, folder: Path) -> None:
        content = change(csv(table))
        path = folder / f"{DAMAGED}.{ending}"
        path.write_bytes(content.encode() if isinstance(content, str) else content)

    return write


def rows(change: Callable[[pd.DataFrame], pd.DataFrame]) -> Damage:
    """Damages the table before it is written."""
    return lambda table, folder: (folder / f"{DAMAGED}.csv").write_text(csv(change(table)), "utf-8") and None


def cells(column: str, where: slice | list[int] | int, value: object) -> Damage:
    """Put one value into some cells of a column."""

    def change(table: pd.DataFrame) -> pd.DataFrame:
        table = table.astype({column: object}) if isinstance(value, str) else table.copy()
        table.iloc[where, table.columns.get_loc(column)] = value
        return table

    return rows(change)


def column(name: str, change: Callable[[np.ndarray], np.ndarray]) -> Damage:
    """Change a whole column."""
    return rows(lambda table: table.assign(**{name: change(table[name].to_numpy())}))


def copy_in_other_session(change: Callable[[pd.DataFrame], pd.DataFrame]) -> Damage:
    """Write the good recording once more, under another session's name."""

    def write(_table: pd.DataFrame, folder: Path) -> None:
        good = pd.read_csv(folder / "condition1_session01_recording01.csv")
        (folder / f"{DAMAGED}.csv").write_text(csv(change(good)), "utf-8")

    return write


def line(content: str, number: int, change: Callable[[str], str]) -> str:
    lines = content.splitlines(keepends=True)
    lines[number] = change(lines[number])
    return "".join(lines)


def shifted(table: pd.DataFrame, row: int, seconds: float) -> pd.DataFrame:
    """Move every stamp from a row on."""
    time = table[TIME].to_numpy().copy()
    time[row:] += seconds
    return table.assign(**{TIME: time})


CASES: dict[str, tuple[Damage, str, str]] = {}  # damage, outcome and what is said of it; filled below


def case(outcome: str) -> Callable[[str, Damage, str], None]:
    def add(name: str, damage: Damage, says: str) -> None:
        CASES[name] = (damage, outcome, says)

    return add


repaired, split, refused = case("repaired"), case("split"), case("quarantined")


# The file itself
refused("empty", text(lambda _: ""), "is empty")
# Its lines
refused("a line too long", text(lambda s: line(s, 50, lambda x: x.replace("\n", ",1.0\n"))), "51")
repaired("cut in the last number", text(lambda s: s[:-3]), "last line")
refused("header again in the middle", text(lambda s: s + s), "line 4002 is the header again")
refused("text in a cell", cells(P1, 7, "error"), "'error' in row 8")
case("passes")("utf-16", text(lambda s: s.encode("utf-16")), "")
# Its channels
refused("empty channel", cells(P2, slice(None), np.nan), "pressure_2_pa")
# Its time
repaired("rows twice", rows(lambda t: t.iloc[sorted([*range(len(t)), *range(590, 600)])]), "10 ")
split(
    "clock restarts",
    rows(lambda t: pd.concat([t[:2000], shifted(t[2000:], 0, -10.0)])),
    "split at 1 restart of the clock",
)
split("gap of a second", rows(lambda t: t.drop(index=range(2000, 2200))), "split at 1 gap of more than 2 lost samples")
repaired("one sample lost", rows(lambda t: t.drop(index=[1500])), "1 ")
refused("another rate", rows(lambda t: t.iloc[::2]), "sample time of 0.01 s")
# Its values
split("a hole in a channel", cells(P1, slice(2000, 2100), np.nan), "without pressure_1_pa after 9.995 s")
repaired("a spike", cells(P1, 1234, 180.0), "spike")
refused("broken wire", cells(P2, slice(1000, None), -62.5), "0 to 250 bar")
refused("saturated", column(P1, lambda p: np.where(p > np.quantile(p, 0.8), 250.0, p)), "the sensor is saturated")
refused("stuck pressure", column(P1, lambda p: np.where(np.arange(len(p)) > 500, p[500], p)), "stays at")
# Its units and signs
refused(
    "position has the other sign",
    column(POSITION, lambda x: -x),
    "the stroke; check sign and zero of the sensor .sign and offset in the mapping., for its travel",
)
refused("position counts from the other end", column(POSITION, lambda x: 250.0 - x), "inverted")
refused("pressures swapped", rows(lambda t: t.rename(columns={P1: P2, P2: P1})[list(t.columns)]), "swapped")
# Its neighbours
refused("the same file", copy_in_other_session(lambda t: t), "same bytes")
refused("the same recording, coarser", copy_in_other_session(lambda t: t.round(2)), "recording")
refused(
    "path that tells nothing",
    lambda t, folder: (folder / "stray.csv").write_text(csv(t), "utf-8") and None,
    "does not give condition and session",
)


@pytest.fixture(scope="module")
def logs(cylinder: Cylinder) -> list[pd.DataFrame]:
    """Three recordings of 20 s from three sessions of the rig's first test."""
    plan = CampaignPlan(seed=5, sessions_per_condition=3, recordings_per_session=1, duration_s=20.0)
    taken = [recording.logger for _, recording in zip(range(3), campaign(cylinder, plan), strict=False)]
    return [pd.read_csv(io.StringIO(csv(table))) for table in taken]


@pytest.fixture
def source(tmp_path: Path, logs: list[pd.DataFrame], cylinder: Cylinder) -> Source:
    folder = tmp_path / "raw"
    folder.mkdir()
    for number, table in enumerate(logs[:2], start=1):
        (folder / f"condition1_session0{number}_recording01.csv").write_text(csv(table), "utf-8")
    recipe = Recipe(
        names=NameRules(r"(?P<session>condition(?P<condition>[^_/]+)_session[^_/]+)_"),
        channels={name: ChannelMapping.from_dict(values) for name, values in CHANNELS.items()},
        cylinder=cylinder.name,
        limits=CheckLimits(cylinder.stroke_m, cylinder.piston_area_m2, cylinder.annulus_area_m2),
    )
    return Source(folder, "*", recipe)


def of_the_damaged(recordings: list[Recording]) -> list[Recording]:
    return [
        recording
        for recording in recordings
        if not recording.name.startswith("condition1_session0") or recording.name.startswith(DAMAGED)
    ]


@pytest.mark.parametrize("name", CASES)
def test_damaged_file(name: str, source: Source, logs: list[pd.DataFrame], tmp_path: Path) -> None:
    damage, outcome, says = CASES[name]
    damage(logs[2].copy(), source.folder)
    result = ingest_folder(source, tmp_path / "recordings", tmp_path / "quarantine.json")
    recordings = read_stored(tmp_path / "recordings")
    good = [recording for recording in recordings if recording not in of_the_damaged(recordings)]
    assert [recording.name for recording in good] == [
        "condition1_session01_recording01",
        "condition1_session02_recording01",
    ]
    assert all(recording.metadata.repairs == () for recording in good)
    bad = of_the_damaged(recordings)
    assert {recording.name for recording in bad} <= {DAMAGED, f"{DAMAGED}_part1", f"{DAMAGED}_part2"}
    reasons = [entry["reason"] for entry in read_json(tmp_path / "quarantine.json")]
    for recording in bad:
        assert np.isfinite(recording.samples()).all()
        np.testing.assert_allclose(np.diff(recording.column("time_s")), recording.sample_time_s, rtol=0.3)
    if outcome == "quarantined":
        assert bad == []
        (reason,) = reasons
        assert re.search(says, reason), reason
        assert reason in result.summary()
        return
    assert reasons == []
    assert len(bad) == (2 if outcome == "split" else 1)
    said = " ".join(sentence for recording in bad for sentence in recording.metadata.repairs)
    assert (said == "") == (outcome == "passes"), said
    assert says in said
    assert said == "" or DAMAGED in result.summary()
