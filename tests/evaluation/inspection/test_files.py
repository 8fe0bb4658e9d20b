"""Files as ``ingest`` takes them: broken ones beside good ones, copies, and sessions that are vented in part."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.evaluation.inspection.files import inspect_files
from cylinder_friction.labelling.label import Labeller
from cylinder_friction.recordings.checks.limits import CheckLimits
from cylinder_friction.recordings.conversion import Recipe
from cylinder_friction.recordings.mapping.calibration import ZeroRules
from cylinder_friction.recordings.mapping.channel_mapping import ChannelMapping
from cylinder_friction.recordings.path_names import NameRules
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.signals.smooth_signals import SignalFilter
from inspected_recordings import made_panes, made_strokes

CHANNELS = {"time_s": "s", "pressure_1_pa": "Pa", "pressure_2_pa": "Pa", "position_m": "m"}


@pytest.fixture(scope="module")
def recipe(cylinder: Cylinder) -> Recipe:
    channels = {name: ChannelMapping.from_dict({"channel": name, "unit": unit}) for name, unit in CHANNELS.items()}
    limits = CheckLimits(cylinder.stroke_m, cylinder.piston_area_m2, cylinder.annulus_area_m2)
    names = NameRules(pattern=r"(?P<session>(?P<condition>[a-z]+)\d+)_")
    return Recipe(names, channels, cylinder.name, limits)


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


def vented(recording: Recording, seconds: float, offset_pa: float) -> Recording:
    """Return a recording that begins with both chambers vented, at rest."""
    rows = round(seconds / recording.sample_time_s)
    noise = np.random.default_rng(9).normal(0.0, 500.0, rows)
    at_rest = {"pressure_1_pa": offset_pa + noise, "pressure_2_pa": noise}
    rest = recording.table.iloc[np.zeros(rows, dtype=int)].assign(
        **at_rest, position_m=lambda t: t.position_m + 1e-8 * noise
    )
    table = pd.concat([rest, recording.table], ignore_index=True)
    return replace(recording, columns=table.assign(time_s=recording.sample_time_s * np.arange(len(table))))


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


def test_what_was_not_vented_is_zeroed_by_its_session(
    tmp_path: Path, cylinder: Cylinder, recipe: Recipe, labeller: Labeller, filters: dict[str, SignalFilter]
) -> None:
    """Both recordings of a session have one offset; only the second begins with vented chambers."""
    offset_pa = 1e5
    strokes = shifted(made_strokes(cylinder), 4, offset_pa)
    with_vent = vented(shifted(made_strokes(cylinder), 5, offset_pa), 4.0, offset_pa)
    files = logged(
        tmp_path, {"a1_before.csv": strokes, "a1_vented.csv": with_vent, "b1_alone.csv": shifted(strokes, 6)}
    )
    subjects = list(inspect_files(files, replace(recipe, zero=ZeroRules(method="found"))))
    assert [subject.outcome for subject in subjects[:2]] == ["repaired", "repaired"]
    assert subjects[0].verdict.endswith("s of a1_vented")
    panes, _ = made_panes(subjects, labeller, filters)
    for pane in panes[:2]:
        out, back = pane.friction["extending"].mean_n, pane.friction["retracting"].mean_n
        assert out == pytest.approx(back, abs=15.0)  # the offset alone is 312 N
    assert "zeros of the pressure sensors not corrected" in " ".join(subjects[2].reasons)
    assert panes[2].friction == {}
    assert "the force still holds a load, or a sensor's zero: 3" in panes[2].subject.verdict
