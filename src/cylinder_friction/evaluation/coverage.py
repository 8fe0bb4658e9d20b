"""How often an estimator's bounds hold the label and true friction, by condition and in the worst session."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cylinder_friction.arrays import Array, Mask
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.realtime.stream import CompiledRun
from cylinder_friction.recordings.columns import ALL_CONDITIONS
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.signals.motion import near_events


@dataclass(frozen=True)
class Coverage:
    """Shares of usable rows within the bounds [%], of one reference in one condition."""

    reference: str  # ``label`` or ``truth``
    condition: str  # Name of the operating condition, or ``all``
    rows: int
    held_percent: float  # Share of all rows
    held_near_events_percent: float | None  # Share of rows near starts, stops and reversals; None without any
    worst_session: str  # The session whose rows are held least often
    worst_session_percent: float
    mean_width_n: float  # Upper less lower bound, mean over the rows [N]


@dataclass(frozen=True, eq=False)
class _CoverageRows:
    condition: str
    session: str
    held: Mask
    near: Mask
    width_n: Array


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
    step = estimator.step_model().for_recordings()
    rows: dict[str, list[_CoverageRows]] = {"label": [], "truth": []}
    for recording in recordings:
        stepped, _ = CompiledRun(step).run(recording.samples(estimator.inputs))
        lower_n, upper_n = estimator.aligned(stepped)[:, 1:].T
        usable = recording.usable()
        if not usable.any():
            continue
        near = near_events(recording.column("velocity_m_s"), round(event_window_s / recording.sample_time_s))
        known = {"label": recording.column("friction_n"), "truth": truth_n.get(recording.name)}
        for reference, values_n in known.items():
            if values_n is not None:
                held = (values_n >= lower_n) & (values_n <= upper_n)
                where = (recording.metadata.condition, recording.metadata.session)
                rows[reference].append(_CoverageRows(*where, held[usable], near[usable], (upper_n - lower_n)[usable]))
    conditions = sorted({recording.metadata.condition for recording in recordings})
    return [
        _coverage(reference, condition, chosen)
        for reference, found in rows.items()
        for condition in (*conditions, ALL_CONDITIONS)
        if (chosen := [each for each in found if condition == ALL_CONDITIONS or each.condition == condition])
    ]


def coverage_metrics(found: Sequence[Coverage], reference: str) -> dict[str, float]:
    """List how often the bounds hold one reference [%], by condition and in all, as metrics of a run."""
    return {
        f"held_by_bounds_percent/condition_{each.condition}": each.held_percent
        for each in found
        if each.reference == reference
    }


def _coverage(reference: str, condition: str, rows: Sequence[_CoverageRows]) -> Coverage:
    held, near = (np.concatenate([getattr(each, name) for each in rows]) for name in ("held", "near"))
    sessions: dict[str, list[Mask]] = {}
    for each in rows:
        sessions.setdefault(each.session, []).append(each.held)
    by_session = {session: 100.0 * float(np.concatenate(parts).mean()) for session, parts in sessions.items()}
    worst = min(by_session, key=lambda session: (by_session[session], session))
    return Coverage(
        reference=reference,
        condition=condition,
        rows=len(held),
        held_percent=100.0 * float(held.mean()),
        held_near_events_percent=100.0 * float(held[near].mean()) if near.any() else None,
        worst_session=worst,
        worst_session_percent=by_session[worst],
        mean_width_n=float(np.concatenate([each.width_n for each in rows]).mean()),
    )
