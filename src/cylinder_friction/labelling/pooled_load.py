"""The mean of the loads of several sessions, as a table over positions."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from cylinder_friction.arrays import Array, Mask
from cylinder_friction.labelling.load import OTHER_REACH_M, LoadIdentification
from cylinder_friction.realtime.position_load import LoadAxis, PositionLoad
from cylinder_friction.recordings.columns import COVERAGE_FACTOR
from cylinder_friction.recordings.recording import RecordingError

POOLED_PLACES = 129
"""Number of positions at which the mean load of several sessions is stored."""
MOST_OTHER_PLACES = 33
"""Greatest number of places along one other position; half as many along each of two."""


def pooled_load(sessions: Sequence[LoadIdentification]) -> PositionLoad:
    """Average the loads of sessions, for an estimator to subtract.

    The mean of loads of one position is known at positions that all sessions know; with several positions, at positions
    that any session knows. Its uncertainty applies to a further session: it combines the spread between two or more
    sessions with the uncertainty of each session's own load.

    Raises:
        RecordingError: There is no session, or they share no stretch of position.
    """
    if not sessions:
        raise RecordingError("a load that depends on position cannot be pooled: got no session; expected at least one")
    if sessions[0].others:
        return _pooled_over_several(sessions)
    firsts, lasts = zip(*(each.range_m for each in sessions), strict=True)
    first_m, last_m = max(firsts), min(lasts)
    if not first_m < last_m:
        raise RecordingError(
            f"the sessions' loads share no position: one is known from {first_m:.4g} m on, one up to {last_m:.4g} m; "
            "record strokes over the same travel in each session"
        )
    position_m = np.linspace(first_m, last_m, POOLED_PLACES)
    loads_n = np.array([each.load_n(position_m) for each in sessions])
    own_n = np.sqrt(np.mean([each.uncertainty_n(position_m) ** 2 for each in sessions], axis=0))
    spread_n = loads_n.std(axis=0, ddof=1) if len(sessions) > 1 else np.zeros(POOLED_PLACES)
    return PositionLoad(first_m, last_m, loads_n.mean(axis=0), np.hypot(own_n, spread_n))


def refuse_unlike_loads(sessions: Mapping[str, LoadIdentification], common: PositionLoad) -> None:
    """Refuse sessions that cannot all carry the common load.

    Raises:
        RecordingError: A session's load differs from the common load by over twice the session's standard uncertainty.
    """
    positions_m = _places(common)
    for name, each in sessions.items():
        own_m = positions_m[each.knows(positions_m)] if each.others else positions_m
        if not len(own_m):
            continue
        off_n, known_n = each.load_n(own_m) - common.at(own_m), each.uncertainty_n(own_m)
        if np.sqrt(np.mean(np.square(off_n / known_n))) > COVERAGE_FACTOR:
            raise RecordingError(
                f"sessions carry different loads: that of {name} is {np.sqrt(np.mean(off_n**2)):.3g} N from the mean "
                f"of the training sessions, known to {known_n.mean():.3g} N; expected at most {COVERAGE_FACTOR:g} "
                "times that; set offset.common_load to false, so that each session keeps its own"
            )


def _pooled_over_several(sessions: Sequence[LoadIdentification]) -> PositionLoad:
    """Average loads of several positions; at each place, over the sessions that know the load there."""
    ranges_m = [(each.range_m, *each.coverage.ranges_m) for each in sessions]
    axes = []
    for number, column in enumerate(sessions[0].columns):
        first_m, last_m = min(own[number][0] for own in ranges_m), max(own[number][1] for own in ranges_m)
        axes.append(LoadAxis(column, first_m, last_m))
    most = MOST_OTHER_PLACES if len(axes) == 2 else MOST_OTHER_PLACES // 2
    counts = [min(most, math.ceil((each.last_m - each.first_m) / OTHER_REACH_M) + 1) for each in axes[1:]]
    shape = (POOLED_PLACES, *counts)
    empty = PositionLoad(*axes[0][1:], np.zeros(shape), np.zeros(shape), tuple(axes[1:]))
    positions_m = _places(empty)
    known = np.array([each.knows(positions_m) for each in sessions])
    loads_n = np.array([each.load_n(positions_m) for each in sessions])
    own_n = np.array([each.uncertainty_n(positions_m) for each in sessions])
    everywhere: Mask = np.reshape(known.any(axis=0), shape)
    from scipy.ndimage import distance_transform_edt  # Only loads by several positions need it

    nearest = distance_transform_edt(~everywhere, return_distances=False, return_indices=True)
    # At an unknown place, average the sessions that know the nearest known place.
    goes_on = known[:, np.ravel_multi_index(tuple(nearest), shape).ravel()]
    count = goes_on.sum(axis=0)
    mean_n = np.where(goes_on, loads_n, 0.0).sum(axis=0) / count
    several = known & (known.sum(axis=0) > 1)
    free = several.sum() - several.any(axis=0).sum()
    off_n = np.where(several, loads_n - mean_n, 0.0)
    spread_n = math.sqrt(float((off_n**2).sum()) / free) if free else 0.0  # of sessions at places that several know
    half_n = np.hypot(np.sqrt(np.where(goes_on, own_n**2, 0.0).sum(axis=0) / count), spread_n)
    tables = [np.reshape(each, shape) for each in (mean_n, half_n)]
    return PositionLoad(axes[0].first_m, axes[0].last_m, tables[0], tables[1], tuple(axes[1:]), everywhere)


def _places(load: PositionLoad) -> Array:
    """Compute the positions of a load's table, shape ``(places, positions)``."""
    along = [np.linspace(*axis[1:], count) for axis, count in zip(load.axes, load.load_n.shape, strict=True)]
    return np.stack([each.ravel() for each in np.meshgrid(*along, indexing="ij")], axis=1)
