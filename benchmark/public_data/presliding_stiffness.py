"""Presliding stiffness from reversals, with its confidence interval: how fast friction rises while bristles bend."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numba
import numpy as np
from scipy.special import stdtrit

from cylinder_friction.recordings.recording import RecordingError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cylinder_friction.arrays import Array


_LEAST_ROWS = 5
_LEAST_REVERSALS = 3
_UNEXPLAINED = 0.1
"""Share of the variance of friction that a curve may leave unexplained."""


@dataclass(frozen=True)
class PreslidingStiffness:
    """Stiffness of the bristles as reversals show it.

    Attributes:
        stiffness_n_m: Mean of both directions [N/m].
        interval_n_m: Its confidence interval [N/m].
        extend_n_m, retract_n_m: Means of the reversals to extension and to retraction [N/m].
        spread_n_m: Standard deviation of single reversals about the mean of their direction [N/m].
        coulomb_n: Friction after the reversals, once it has settled [N].
        reversals_extend, reversals_retract: How many gave a slope.
        left_out: Reversals that gave none: too few rows, no rise through zero, or no curve.
        confidence: Probability of the interval.
    """

    stiffness_n_m: float
    interval_n_m: tuple[float, float]
    extend_n_m: float
    retract_n_m: float
    spread_n_m: float
    coulomb_n: float
    reversals_extend: int
    reversals_retract: int
    left_out: int
    confidence: float

    def to_dict(self) -> dict[str, Any]:
        """Return all of it as JSON takes it."""
        return {key: list(value) if isinstance(value, tuple) else value for key, value in sorted(asdict(self).items())}


def presliding_stiffness(
    position_m: Array,
    friction_n: Array,
    least_travel_m: float,
    level: float = 0.5,
    confidence: float = 0.95,
) -> PreslidingStiffness:
    """Return the slope of friction over travel where friction passes through zero after a reversal.

    There LuGre's bristles are straight, dz/dx = 1, and the slope is their stiffness s0 whatever shape the rest of
    the curve has. It is that of a parabola through the rows within ``level`` of Coulomb friction either way, at its
    zero. Reversals differ by more than noise, and neighbours are alike, so the interval is Student's t of the mean of
    each direction over as many reversals as are independent by their lag-one correlation.

    What gives way between the sensor of position and the sliding contact (rod, mounting, load cell) bends with the
    bristles: the figure is that of both springs in series, a lower bound of the bristles' own.

    Args:
        position_m: [m], shape ``(n,)``.
        friction_n: Friction, positive when it opposes extension [N], shape ``(n,)``.
        least_travel_m: Way back after which a turn counts as a reversal; more than position noise [m].
        level: Share of Coulomb friction, up to which rows count, in (0, 1).
        confidence: Probability of the interval.

    Raises:
        ValueError: ``level`` or ``confidence`` is not within 0 and 1, or ``least_travel_m`` not positive.
        RecordingError: Fewer than three reversals of either direction show a slope.

    Source: Dahl 1968; Canudas de Wit, Olsson, Astrom and Lischinsky 1995, section III.
    """
    if not (0.0 < level < 1.0 and 0.0 < confidence < 1.0 and least_travel_m > 0.0):
        raise ValueError(
            "presliding_stiffness: expected level and confidence between 0 and 1 and a positive least_travel_m, but "
            f"got {level!r}, {confidence!r} and {least_travel_m!r}"
        )
    turns = _turning_rows(np.ascontiguousarray(position_m), least_travel_m)
    coulomb = _settled_friction(position_m, friction_n, turns)
    slopes: dict[float, list[float]] = {1.0: [], -1.0: []}
    left_out = 0
    for begin, end in pairwise(turns):
        way = math.copysign(1.0, position_m[end] - position_m[begin])
        slope = _slope(position_m[begin : end + 1], friction_n[begin : end + 1] * way, way, level * coulomb)
        if slope is None:
            left_out += 1
        else:
            slopes[way].append(slope)
    extend, retract = np.array(slopes[1.0]), np.array(slopes[-1.0])
    if min(len(extend), len(retract)) < _LEAST_REVERSALS:
        raise RecordingError(
            f"presliding stiffness cannot be identified: got {len(extend)} reversals to extension and {len(retract)} "
            f"to retraction that show friction rise through zero ({left_out} more do not); expected at least "
            f"{_LEAST_REVERSALS} of each; record more reversals, sample faster, or lower least_travel_m "
            f"({least_travel_m:g} m)"
        )
    mean = 0.5 * float(extend.mean() + retract.mean())
    parts = [_variance_of_mean(each) for each in (extend, retract)]
    error = 0.5 * math.sqrt(sum(variance for variance, _ in parts))
    reach = float(stdtrit(max(1.0, min(free for _, free in parts)), 0.5 + 0.5 * confidence)) * error
    deviations = np.concatenate([extend - extend.mean(), retract - retract.mean()])
    return PreslidingStiffness(
        stiffness_n_m=mean,
        interval_n_m=(mean - reach, mean + reach),
        extend_n_m=float(extend.mean()),
        retract_n_m=float(retract.mean()),
        spread_n_m=float(np.sqrt(np.sum(deviations**2) / (len(deviations) - 2))),
        coulomb_n=coulomb,
        reversals_extend=len(extend),
        reversals_retract=len(retract),
        left_out=left_out,
        confidence=confidence,
    )


def _settled_friction(position_m: Array, friction_n: Array, turns: NDArray[np.int64]) -> float:
    """Return the median over strokes of friction's size in the last third of their travel [N]."""
    levels = []
    for begin, end in pairwise(turns):
        way = position_m[end] - position_m[begin]
        late = (position_m[begin : end + 1] - position_m[begin]) / way > 2.0 / 3.0
        levels.append(float(np.median(np.abs(friction_n[begin : end + 1][late]))))
    return float(np.median(levels)) if levels else 0.0


def _slope(position_m: Array, friction_along_n: Array, way: float, level_n: float) -> float | None:
    """Return the slope of one stroke's rise through zero [N/m]; None where it shows none."""
    begin, end = (_crossing(friction_along_n, each) for each in (-level_n, level_n))
    if begin is None or end is None:
        return None
    rows = slice(begin, end)
    travel, force = position_m[rows] * way, friction_along_n[rows]
    if len(force) < _LEAST_ROWS or np.ptp(travel) <= 0.0:
        return None
    along = (travel - travel.mean()) / np.ptp(travel)
    curve = np.polyfit(along, force, 2)
    unexplained = float(np.var(force - np.polyval(curve, along)) / np.var(force))
    # The derivative of a parabola at its rising zero is the root of its discriminant.
    steepness = curve[1] ** 2 - 4.0 * curve[0] * curve[2]
    if unexplained > _UNEXPLAINED or steepness <= 0.0 or force[-1] <= force[0]:
        return None
    return math.sqrt(steepness) / float(np.ptp(travel))


def _crossing(friction_n: Array, level_n: float) -> int | None:
    """Return the row at which rising friction passes a level; None where it does not.

    Noise passes it several times; in the middle between the first and the last of them it is as likely up as down.
    """
    above = friction_n >= level_n
    if above[0] or not above.any():
        return None
    first = int(np.argmax(above))
    settled = int(np.argmax(friction_n >= np.median(friction_n[first:])))
    last = int(np.flatnonzero(~above[: max(first, settled) + 1])[-1]) + 1
    return (first + last) // 2


def _variance_of_mean(values: Array) -> tuple[float, float]:
    """Return the variance of the mean of alike neighbours, and its degrees of freedom."""
    rest = values - values.mean()
    total = float(rest @ rest)
    alike = min(max(float(rest[:-1] @ rest[1:]) / total, 0.0), 0.95) if total > 0.0 else 0.0
    independent = max(len(values) * (1.0 - alike) / (1.0 + alike), 2.0)
    return total / (len(values) - 1) / independent, independent - 1.0


@numba.njit(cache=True)
def _turning_rows(position: Array, least_travel: float) -> NDArray[np.int64]:
    """Return the last row before each way back of ``least_travel``, ends of the first and last stroke left out."""
    turns = np.empty(position.shape[0], dtype=np.int64)
    count, way, extreme = 0, 0, 0
    lowest, highest = 0, 0
    for row in range(position.shape[0]):
        if way == 0:
            if position[row] <= position[lowest]:
                lowest = row
            if position[row] >= position[highest]:
                highest = row
            if position[row] - position[lowest] >= least_travel:
                way, extreme = 1, row
            elif position[highest] - position[row] >= least_travel:
                way, extreme = -1, row
        elif way * (position[row] - position[extreme]) >= 0.0:
            extreme = row
        elif way * (position[extreme] - position[row]) >= least_travel:
            turns[count] = extreme
            count += 1
            way, extreme = -way, row
    return turns[:count].copy()
