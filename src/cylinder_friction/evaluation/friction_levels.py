"""Friction at equal pressures, speed and direction: the sources of a difference between recordings, and its rest.

Steady sliding is sorted by direction, by the sum of both pressures in steps of ``PRESSURE_STEP_BAR``, and by speed in
steps of a factor of two. Where recordings share such a cell, their friction is compared in it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.recordings.columns import PRESSURES
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.signals.motion import direction_of_motion, steady_rows, stroke_pieces
from cylinder_friction.signals.smooth_signals import has_pressures

PRESSURE_STEP_BAR = 25.0
SLOWEST_M_S = 2e-3
STEADY_VARIATION = 0.4
"""Greatest variation of velocity, over its mean, in steady sliding."""
SETTLING_S, PIECE_S = 0.2, 0.1
"""Time left out after a start or a reversal, and duration of one mean [s]."""
LEAST_S, LEAST_CELLS, MOST_ALONE = 1.0, 3, 1.5
"""Least sliding [s] and cells shared with another recording for a difference to be stated, and the limit of how
unevenly the sliding is spread over the cells."""
CONFIDENCE = 0.95
"""Probability that the interval of a recording holds if its friction is that of the others."""
FACTORS = {"pressures": ("pressure_bar",), "speed": ("speed_mm_s",), "direction": ("direction",)}


@dataclass(frozen=True)
class FrictionLevel:
    """Friction of steady sliding of a recording in one direction, at one level of pressure and speed."""

    direction: int  # 1 extending, -1 retracting
    # Lower edges of the cell: sum of both pressures, ``PRESSURE_STEP_BAR`` wide, and speed, up to twice this
    pressure_bar: float
    speed_mm_s: float
    friction_n: float  # Mean force against the motion
    seconds: float  # Duration of sliding


@dataclass(frozen=True)
class Difference:
    """Difference of a recording's friction from that of the others in the cells that they share."""

    newtons: float
    half_width_n: float  # Half its interval, from the scatter between cells; infinite with too few
    seconds: float  # Duration of sliding in these cells

    @property
    def is_unexplained(self) -> bool:
        """Whether friction differs by more than its scatter."""
        return abs(self.newtons) > self.half_width_n


@dataclass(frozen=True)
class RecordingDifference:
    """Friction of one recording beside that of all others."""

    name: str
    friction_n: float  # Mean of all steady sliding
    differs_n: float  # Difference from the mean of all others
    # The rest of it at equal pressures, at equal speed and in equal direction, each by itself
    left_n: Mapping[str, float | None]
    equal: Difference | None  # The rest at all three together; None if recordings hardly share a cell


def friction_levels(recordings: Iterable[Recording]) -> tuple[FrictionLevel, ...]:
    """Compute the levels of labelled recordings, or of the parts of one, sorted; none without pressures."""
    sums: dict[tuple[float, ...], list[float]] = {}
    for recording in recordings:
        if not has_pressures(recording):
            continue
        velocity_m_s, step_s = recording.column("velocity_m_s"), recording.sample_time_s
        steady = recording.usable() & steady_rows(velocity_m_s, step_s, SLOWEST_M_S, STEADY_VARIATION)
        direction = np.where(steady, direction_of_motion(velocity_m_s, SLOWEST_M_S), 0.0)
        time_s = step_s * np.arange(len(recording), dtype=np.float64)
        pieces = stroke_pieces(direction, time_s, SETTLING_S, max(1, round(PIECE_S / step_s)))
        if not len(pieces.rows):
            continue
        sign = direction[pieces.rows[pieces.begins]]
        pressure_bar = 1e-5 * pieces.mean(recording.column(PRESSURES[0]) + recording.column(PRESSURES[1]))
        level = PRESSURE_STEP_BAR * np.floor(pressure_bar / PRESSURE_STEP_BAR)
        speed = np.exp2(np.floor(np.log2(1e3 * np.abs(pieces.mean(velocity_m_s)))))
        friction_n, seconds = sign * pieces.mean(recording.column("friction_n")), step_s * pieces.counts
        for *cell, newtons, own_s in np.column_stack([sign, level, speed, friction_n * seconds, seconds]).tolist():
            found = sums.setdefault(tuple(cell), [0.0, 0.0])
            found[0] += newtons
            found[1] += own_s
    return tuple(
        FrictionLevel(int(cell[0]), cell[1], cell[2], total / seconds, seconds)
        for cell, (total, seconds) in sorted(sums.items())
    )


def differences(levels: Mapping[str, Sequence[FrictionLevel]]) -> tuple[RecordingDifference, ...]:
    """Compare friction of each recording with that of the others; empty for a single recording.

    Recordings that never slide steadily are left out.
    """
    known = {name: own for name, own in levels.items() if own}
    if len(known) < 2:
        return ()
    by_factor = {factor: _Cells.of(known, fields) for factor, fields in FACTORS.items()}
    at_all, together = _Cells.of(known, ()), _Cells.of(known, ("direction", "pressure_bar", "speed_mm_s"))
    found = []
    for name, own in known.items():
        left = {factor: cells.beside(name) for factor, cells in by_factor.items()}
        raw, every = at_all.beside(name), together.beside(name)
        assert raw is not None
        numbers = {factor: None if each is None else each.newtons for factor, each in left.items()}
        enough = every is not None and math.isfinite(every.half_width_n) and every.seconds >= LEAST_S
        found.append(RecordingDifference(name, _mean(own)[0], raw.newtons, numbers, every if enough else None))
    return tuple(found)


def in_words(found: Sequence[RecordingDifference]) -> str:
    """State in one sentence what differs and what remains; empty if nothing can be compared."""
    equal = {each.name: each.equal for each in found if each.equal is not None}
    if not equal:
        return ""
    friction = [each.friction_n for each in found]
    spread = f"the mean in steady sliding is {min(friction):z.0f} to {max(friction):z.0f} N from recording to recording"
    unexplained = [name for name, each in equal.items() if each.is_unexplained]
    still = sorted(unexplained, key=lambda name: -abs(equal[name].newtons))
    if not still:
        return f"{spread}; at equal pressures, speed and direction recordings agree within their scatter"
    if len(equal) == 2:  # each is compared with the other one: a single difference
        still = still[:1]
    shown = [f"{name} {equal[name].newtons:+.0f} ± {equal[name].half_width_n:.0f} N" for name in still[:3]]
    more = f" and {len(still) - 3} more" if len(still) > 3 else ""
    return (
        f"{spread}; at equal pressures, speed and direction it differs from the others' for {', '.join(shown)}{more}. "
        f"Something else differs, such as pressures within {PRESSURE_STEP_BAR:g} bar, position, the oil's temperature, "
        "the load or a sensor's zero"
    )


@dataclass(frozen=True)
class _Cells:
    """Mean friction and duration of each recording in each cell, and those of all recordings together."""

    of_each: Mapping[str, Mapping[tuple[float, ...], tuple[float, float]]]
    friction_n: Mapping[tuple[float, ...], Array]  # Of all recordings, ascending
    seconds: Mapping[tuple[float, ...], float]

    @classmethod
    def of(cls, levels: Mapping[str, Sequence[FrictionLevel]], fields: tuple[str, ...]) -> Self:
        of_each: dict[str, dict[tuple[float, ...], tuple[float, float]]] = {}
        together: dict[tuple[float, ...], list[tuple[float, float]]] = {}
        for name, own in levels.items():
            cells: dict[tuple[float, ...], list[FrictionLevel]] = {}
            for each in own:
                cells.setdefault(tuple(getattr(each, field) for field in fields), []).append(each)
            of_each[name] = {cell: _mean(inside) for cell, inside in sorted(cells.items())}
            for cell, mean in of_each[name].items():
                together.setdefault(cell, []).append(mean)
        friction_n = {cell: np.sort([mean for mean, _ in means]) for cell, means in together.items()}
        return cls(of_each, friction_n, {cell: sum(own for _, own in means) for cell, means in together.items()})

    def beside(self, name: str) -> Difference | None:
        """Compute the difference from the median of the others, weighted by shared sliding; None if they share none."""
        from scipy.special import stdtrit  # slow to import

        off_n, own_s, shared_s = [], [], []
        for cell, (newtons, seconds) in self.of_each[name].items():
            others = len(self.friction_n[cell]) - 1
            if not others:
                continue
            own = int(np.searchsorted(self.friction_n[cell], newtons))
            middle = [place + (place >= own) for place in ((others - 1) // 2, others // 2)]
            off_n.append(newtons - float(self.friction_n[cell][middle].mean()))
            own_s.append(seconds)
            shared_s.append(min(seconds, self.seconds[cell] - seconds))
        if not off_n:
            return None
        weights = np.array(shared_s) / sum(shared_s)
        total_n = float(weights @ np.array(off_n))
        count = 1.0 / float((weights**2).sum())  # effective number of cells
        half_n = math.inf
        if len(off_n) >= LEAST_CELLS and count > MOST_ALONE:
            quantile = float(stdtrit(count - 1.0, 0.5 + 0.5 * CONFIDENCE))
            half_n = quantile * math.sqrt(float(weights @ (np.array(off_n) - total_n) ** 2) / (count - 1.0))
        return Difference(total_n, half_n, sum(own_s))


def _mean(levels: Sequence[FrictionLevel]) -> tuple[float, float]:
    """Compute mean friction [N] and duration [s]."""
    seconds = sum(each.seconds for each in levels)
    return sum(each.friction_n * each.seconds for each in levels) / seconds, seconds
