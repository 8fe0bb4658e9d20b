"""The force at which the piston breaks away after rest."""

from collections.abc import Sequence

import numpy as np

from cylinder_friction import Cylinder, Recording
from cylinder_friction.signals.motion import standstill_rows
from cylinder_friction_monitoring.trends.blocks import drive_force_n
from cylinder_friction_monitoring.trends.plan import IndicatorPlan
from cylinder_friction_monitoring.trends.session_row import Indicator

BREAKS_WITHIN_S = 1.5  # Longest time between a rest and the start that belongs to it [s]
MOVED_M = 1e-3  # Travel after which the piston has broken away [m]
_SEED = 22


def breakaway(recordings: Sequence[Recording], cylinder: Cylinder, plan: IndicatorPlan) -> Indicator:
    """Compute half the difference of the median breakaway forces out and back, which is free of zeros [N]."""
    ways: dict[float, list[float]] = {1.0: [], -1.0: []}
    for recording in recordings:
        for way, force_n in _starts(recording, cylinder, plan):
            ways[way].append(force_n)
    if min(map(len, ways.values())) < 2:
        counts = f"{len(ways[1.0])} starts from rest out and {len(ways[-1.0])} back"
        return Indicator(None, why=f"{counts}; 2 each way are needed")
    generator = np.random.default_rng(_SEED)
    drawn = [
        np.median(np.array(own)[generator.integers(0, len(own), (plan.bootstrap, len(own)))], axis=1)
        for own in ways.values()
    ]
    value = 0.5 * float(np.median(ways[1.0]) - np.median(ways[-1.0]))
    return Indicator(value, 0.5 * float((drawn[0] - drawn[1]).std(ddof=1)))


def _starts(recording: Recording, cylinder: Cylinder, plan: IndicatorPlan) -> list[tuple[float, float]]:
    """Find the direction and the greatest force, smoothed over 20 ms, of each start from rest."""
    step_s, position_m = recording.sample_time_s, recording.column("position_m")
    rows = max(1, round(0.02 / step_s))
    force_n = np.convolve(drive_force_n(recording, cylinder, plan), np.full(rows, 1.0 / rows), mode="same")
    usable = recording.usable()
    rest = standstill_rows(position_m, step_s)
    starts = []
    for end in np.flatnonzero(np.diff(rest.astype(np.int8)) == -1) + 1:
        window = slice(int(end), int(end) + round(BREAKS_WITHIN_S / step_s))
        travel_m = position_m[window] - position_m[end - 1]
        moved = np.flatnonzero(np.abs(travel_m) > MOVED_M)
        if not len(moved) or not usable[window][: moved[0] + 1].all():
            continue
        way = float(np.sign(travel_m[moved[0]]))
        until = force_n[max(int(end) - rows, 0) : int(end) + int(moved[0]) + 1]
        starts.append((way, way * float((way * until).max())))
    return starts
