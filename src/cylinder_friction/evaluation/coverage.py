"""How often an estimator's bounds hold the label and true friction: by condition, session, and kind of motion."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pandas as pd

from cylinder_friction.arrays import Array
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.realtime.stream import CompiledRun
from cylinder_friction.recordings.columns import ALL_CONDITIONS
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.signals.motion import near_events

By = Literal["condition", "session", "speed", "acceleration", "motion"]
CLASSES = 3
"""Classes of speed and of acceleration, with as many rows in each."""
NEAR = "near starts, stops and reversals"


@dataclass(frozen=True)
class Coverage:
    """Share of usable rows within the bounds, of one reference in one group of rows."""

    reference: str  # ``label`` or ``truth``
    by: By  # What the group is of
    group: str  # The condition, or ``all``; the session; or the range of speeds or accelerations
    rows: int
    held_percent: float  # Share of these rows [%]
    mean_width_n: float  # Upper less lower bound, mean over the rows [N]


def coverage(
    estimator: FrictionEstimator,
    recordings: Sequence[Recording],
    truth_n: Mapping[str, Array],
    event_window_s: float = 0.1,
) -> list[Coverage]:
    """Measure the coverage of the label and, if known, of true friction; empty without calibrated bounds.

    Args:
        estimator: Fitted and calibrated estimator.
        recordings: Held-out recordings with ``velocity_m_s``, ``friction_n`` and ``usable``.
        truth_n: True friction [N] by recording name, as far as it is known.
        event_window_s: Rows within this time of a start, stop or reversal count as near it [s].
    """
    if estimator.bounds is None:
        return []
    rows = pd.concat([_rows(estimator, each, truth_n, event_window_s) for each in recordings])
    rows["speed"] = _classes(rows["speed"], 1e3, "mm/s")
    rows["acceleration"] = _classes(rows["acceleration"], 1.0, "m/s²")
    return [
        each
        for reference in ("label", "truth")
        if not (known := rows[rows[reference].notna()]).empty
        for each in _of_reference(reference, known)
    ]


def _rows(
    estimator: FrictionEstimator, recording: Recording, truth_n: Mapping[str, Array], event_window_s: float
) -> pd.DataFrame:
    """Tabulate the usable rows of a recording: where they belong, and whether the bounds hold each reference."""
    stepped, _ = CompiledRun(estimator.step_model().for_recordings()).run(recording.samples(estimator.inputs))
    lower_n, upper_n = estimator.aligned(stepped)[:, 1:].T
    velocity_m_s = recording.column("velocity_m_s")
    near = near_events(velocity_m_s, round(event_window_s / recording.sample_time_s))

    def held(values_n: Array) -> Array:
        return np.where((values_n >= lower_n) & (values_n <= upper_n), 100.0, 0.0)

    unknown = np.full(len(recording), np.nan)
    columns = {
        "condition": recording.metadata.condition,
        "session": recording.metadata.session,
        "speed": np.abs(velocity_m_s),
        "acceleration": np.abs(np.gradient(velocity_m_s, recording.sample_time_s)),
        "motion": np.where(near, NEAR, "elsewhere"),
        "label": held(recording.column("friction_n")),
        "truth": held(truth_n[recording.name]) if recording.name in truth_n else unknown,
        "width_n": upper_n - lower_n,
    }
    return pd.DataFrame(columns)[recording.usable()]


def _classes(values: pd.Series, scale: float, unit: str) -> pd.Series:
    """Name each value's class: classes with as many rows in each, from the smallest values up."""
    edges = np.unique([float(f"{scale * each:.2g}") for each in values.quantile(np.arange(1, CLASSES) / CLASSES)])
    names = [f"up to {edge:g} {unit}" for edge in edges]
    place = np.searchsorted(edges, scale * values)
    return pd.Series(np.array([*names, f"above {edges[-1]:g} {unit}"])[place], values.index)


def _of_reference(reference: str, rows: pd.DataFrame) -> Iterator[Coverage]:
    for by in ("condition", "session", "speed", "acceleration", "motion"):
        for group, own in rows.groupby(by):
            yield _coverage(reference, by, str(group), own)
        if by == "condition":
            yield _coverage(reference, by, ALL_CONDITIONS, rows)


def _coverage(reference: str, by: By, group: str, rows: pd.DataFrame) -> Coverage:
    return Coverage(reference, by, group, len(rows), float(rows[reference].mean()), float(rows["width_n"].mean()))


def by_condition(found: Sequence[Coverage], reference: str) -> dict[str, float]:
    """List how often the bounds hold one reference [%], by condition and in all."""
    return {each.group: each.held_percent for each in found if (each.reference, each.by) == (reference, "condition")}
