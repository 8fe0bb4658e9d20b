"""Files as ``ingest`` takes them: broken ones beside good ones, and copies."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.evaluation.inspection.files import inspect_files
from cylinder_friction.recordings.checks.limits import CheckLimits
from cylinder_friction.recordings.logs import NameRules, Recipe, StartRules
from cylinder_friction.recordings.mapping.channel_mapping import ChannelMapping
from cylinder_friction.recordings.recording import Recording
from inspected_recordings import made_strokes

CHANNELS = {"time_s": "s", "pressure_1_pa": "Pa", "pressure_2_pa": "Pa", "position_m": "m"}


@pytest.fixture(scope="module")
def recipe(cylinder: Cylinder) -> Recipe:
    channels = {name: ChannelMapping.from_dict({"channel": name, "unit": unit}) for name, unit in CHANNELS.items()}
    names = NameRules(pattern=r"(?P<session>(?P<condition>[a-z]+)\d+)_")
    return Recipe(names, channels, CheckLimits(cylinder))


def logged(folder: Path, recordings: dict[str, Recording | bytes]) -> dict[str, Path]:
    """Write each recording as CSV, or the bytes as they are; returns the files by name."""
    for name, recording in recordings.items():
        if isinstance(recording, bytes):
            (folder / name).write_bytes(recording)
        else:
            recording.table.to_csv(folder / name, index=False)
    return {name: folder / name for name in recordings}


def shifted(recording: Recording, seed: int, offset_pa: float = 0.0) -> Recording:
    """Return a recording with noise and an offset of its own on the first pressure."""
    noise = np.random.default_rng(seed).normal(0.0, 2e3, len(recording))
    return recording.with_columns(pressure_1_pa=recording.column("pressure_1_pa") + offset_pa + noise)


def test_broken_files_stand_beside_good_ones_in_their_order(tmp_path: Path, cylinder: Cylinder, recipe: Recipe) -> None:
    good = made_strokes(cylinder)
    files = logged(
        tmp_path,
        {
            "a1_z.csv": good,
            "a1_y.csv": b"",
            "a1_x.csv": b"\x00\xff" * 3000,
            "nothing.csv": shifted(good, 1),
            "a2_w.csv": shifted(good, 2),
        },
    )
    subjects = list(inspect_files({**files, "a3_gone.csv": tmp_path / "gone.csv"}, recipe))
    assert [subject.file for subject in subjects] == [*files, "a3_gone.csv"]
    assert [subject.outcome for subject in subjects] == ["ok", "refused", "refused", "noted", "ok", "refused"]
    assert subjects[1].verdict.startswith("not usable: the file is empty")
    assert subjects[3].verdict.startswith("usable for labelling; worth knowing: ")


def test_an_unknown_start_is_a_note_and_no_repair(tmp_path: Path, cylinder: Cylinder, recipe: Recipe) -> None:
    dated = replace(recipe, start=StartRules(pattern=r"(?P<year>\d{4})-(?P<month>\d\d)-(?P<day>\d\d)"))
    files = logged(
        tmp_path, {"a1_2026-03-27.csv": made_strokes(cylinder), "a2_.csv": shifted(made_strokes(cylinder), 1)}
    )
    known, unknown = inspect_files(files, dated)
    assert known.outcome == "ok"
    assert [finding.check for finding in unknown.findings if finding.outcome == "noted"] == ["start"]
    assert unknown.verdict.startswith("usable for labelling; worth knowing: start.pattern ")
