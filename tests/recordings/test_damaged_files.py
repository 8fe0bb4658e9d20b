"""Damaged files beside good ones: each comes out as it should, says why, and never stops the good ones."""

import io
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

TIME, P1, P2, POSITION = "Time [s]", "P1 [bar]", "P2 [bar]", "Position [mm]"
CHANNELS = {
    "time_s": {"channel": TIME, "unit": "s"},
    "pressure_1_pa": {"channel": P1, "unit": "bar", "sensor": {"range": [0.0, 250.0], "unit": "bar", "bits": 12}},
    "pressure_2_pa": {"channel": P2, "unit": "bar", "sensor": {"range": [0.0, 250.0], "unit": "bar", "bits": 12}},
    "position_m": {"channel": POSITION, "unit": "mm"},
}
DAMAGED = "condition1_session09_recording01"


def csv(table: pd.DataFrame) -> str:
    return str(table.to_csv(index=False, float_format="%.3f", lineterminator="\n"))


def with_spike(table: pd.DataFrame) -> pd.DataFrame:
    return table.assign(**{P1: table[P1].where(table.index != 1234, 180.0)})


Damage = Callable[[pd.DataFrame, pd.DataFrame], str]
"""Returns the text of the damaged file, made from a log of its own and the log of another file."""

TOLD: dict[str, tuple[Damage, list[str]]] = {
    "one sample lost": (lambda log, _: csv(log.drop(index=[1500])), ["1 "]),
    "cut in the last number": (lambda log, _: csv(log)[:-3], ["last line"]),
    "a spike": (lambda log, _: csv(with_spike(log)), ["spike"]),
    "gap of a second": (
        lambda log, _: csv(log.drop(index=range(2000, 2200))),
        ["split at 1 gap of more than 2 lost"] * 2,
    ),
}
"""Damages, and what each recording that comes of the file says of it."""

REFUSED: dict[str, tuple[Damage, str]] = {
    "empty": (lambda *_: "", "is empty"),
    "header again in the middle": (lambda log, _: csv(log) * 2, "line 4002 is the header again"),
    "another rate": (lambda log, _: csv(log.iloc[::2]), "sample time of 0.01 s"),
    "broken wire": (lambda log, _: csv(log.assign(**{P2: log[P2].where(log.index < 1000, -62.5)})), "0 to 250 bar"),
    "position counts from the other end": (
        lambda log, _: csv(log.assign(**{POSITION: 250.0 - log[POSITION]})),
        "inverted",
    ),
    "the same file": (lambda _, other: csv(other), "same bytes"),
    "the same recording, coarser": (lambda _, other: csv(other.round(2)), "recording"),
}


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


def ingest_with(damage: Damage, source: Source, logs: list[pd.DataFrame]) -> tuple[list[Recording], list[str], str]:
    """Return the recordings of the damaged file, the reasons of what was refused, and the summary."""
    (source.folder / f"{DAMAGED}.csv").write_text(damage(logs[2], logs[0]), "utf-8")
    folder = source.folder.parent
    result = ingest_folder(source, folder / "recordings", folder / "quarantine.json")
    first, second, *others = read_stored(folder / "recordings")
    assert [first.name, second.name] == ["condition1_session01_recording01", "condition1_session02_recording01"]
    assert first.metadata.repairs == second.metadata.repairs == ()
    return others, [entry["reason"] for entry in read_json(folder / "quarantine.json")], result.summary()


@pytest.mark.parametrize("name", TOLD)
def test_a_damage_that_can_be_repaired_is_told(name: str, source: Source, logs: list[pd.DataFrame]) -> None:
    damage, told = TOLD[name]
    recordings, reasons, summary = ingest_with(damage, source, logs)
    assert reasons == []
    parts = [DAMAGED] if len(told) == 1 else [f"{DAMAGED}_part1", f"{DAMAGED}_part2"]
    assert [recording.name for recording in recordings] == parts
    for recording, says in zip(recordings, told, strict=True):
        assert np.isfinite(recording.samples()).all()
        np.testing.assert_allclose(np.diff(recording.column("time_s")), recording.sample_time_s, rtol=0.3)
        assert says in " ".join(recording.metadata.repairs)
        assert recording.name in summary


@pytest.mark.parametrize("name", REFUSED)
def test_a_damage_that_cannot_be_repaired_is_the_reason(name: str, source: Source, logs: list[pd.DataFrame]) -> None:
    damage, says = REFUSED[name]
    recordings, (reason,), summary = ingest_with(damage, source, logs)
    assert recordings == []
    assert says in reason
    assert reason in summary
