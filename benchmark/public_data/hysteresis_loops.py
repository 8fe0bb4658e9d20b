"""Measured hysteresis: loops of force over travel, their turns, the work of a cycle and the stiffness behind a turn."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from cylinder_friction.friction_models.stribeck import StribeckCurve
from cylinder_friction.recordings.recording import Recording, RecordingMetadata
from cylinder_friction.signals.smooth_signals import smooth_columns
from cylinder_friction.signals.zero_phase import SavitzkyGolay
from public_data import labelled, recordings_of

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from cylinder_friction.arrays import Array

RIGS = ("damper 36 lb", "damper 30 lb", "tribometer")
IDENTIFIED = "identified"

_INCH_M, _KIP_N = 0.0254, 4448.2216
_DAMPERS = {
    "damper 36 lb": "dataset-2/characterization datasets/",
    "damper 30 lb": "dataset-3/characterization tests/",
}
_THINNING = 4
_DAMPER_FILTER = SavitzkyGolay(0.02, 2, 0.02, 2, 0.02, 2)


@dataclass(frozen=True)
class Loops:
    """One measured stretch of motion to and fro, at one sample time.

    Attributes:
        name: Of the recording.
        sample_time_s: Time between two rows [s].
        position_m, velocity_m_s: Of the moving part, shape ``(n,)``; the velocity is the filter's, zero phase.
        friction_n: Measured, positive when it opposes positive velocity, shape ``(n,)``.
        scored: Name of a set to its rows, shape ``(n,)``; models are identified on the set ``identified``.
    """

    name: str
    sample_time_s: float
    position_m: Array
    velocity_m_s: Array
    friction_n: Array
    scored: dict[str, NDArray[np.bool_]]


@dataclass(frozen=True)
class Rig:
    """What one rig was measured in.

    Attributes:
        loops: Every stretch.
        start: Friction of steady sliding from which the search starts.
        stiffness_n_m: The same of presliding [N/m].
        least_travel_m: Way back after which a turn counts [m].
    """

    loops: list[Loops]
    start: StribeckCurve
    stiffness_n_m: float
    least_travel_m: float

    @property
    def sets(self) -> list[str]:
        return list(dict.fromkeys(name for loops in self.loops for name in loops.scored))


def rig_of(data: Path, name: str) -> Rig:
    """Return one of ``RIGS`` as measured; ``data`` holds ``friction-damper`` and ``tribometer``."""
    return damper(data, name) if name in _DAMPERS else tribometer(data)


def damper(data: Path, name: str) -> Rig:
    """Return the sines of one band tension, filtered, one row in four."""
    measured = np.load(data / "friction-damper/brfd.npz")
    head = _DAMPERS[name]
    loops = []
    for key in sorted(key for key in measured.files if key.startswith(head)):
        hertz, rest = key.removeprefix(head).split("Hz")
        amplitude = rest.removesuffix("amplitude").split("tension")[1]
        loops.append(_damper_loops(measured[key].astype(np.float64), key, float(hertz), float(amplitude)))
    return _rig(loops, 3e-3)


def _damper_loops(rows: Array, name: str, hertz: float, amplitude: float) -> Loops:
    time_s = float(np.median(np.diff(rows[:, 0])))
    position, force = _INCH_M * rows[:, 1], _KIP_N * rows[:, 2]
    table = pd.DataFrame({"time_s": time_s * np.arange(len(rows)), "position_m": position, "drive_force_n": force})
    columns = smooth_columns(Recording(RecordingMetadata(name, "", "", time_s), table), _DAMPER_FILTER)
    kept = slice(None, None, _THINNING)
    position, velocity = position[kept], columns["velocity_m_s"][kept]
    if hertz >= 1.0:
        scored = {"1 Hz and faster": np.ones(len(position), dtype=np.bool_)}
    elif amplitude == 1.0:
        scored = {"amplitude between": np.ones(len(position), dtype=np.bool_)}
    else:
        scored = _halves(len(position))
    return Loops(name, _THINNING * time_s, position, velocity, columns["drive_force_smooth_n"][kept], scored)


def tribometer(data: Path) -> Rig:
    """Return the reciprocating test from the first motion to the last."""
    (raw,) = recordings_of(data / "tribometer/test_data_2.txt", "tribometer")
    (whole,), _ = labelled([raw], "tribometer")
    first, last = np.flatnonzero(np.abs(whole.column("velocity_m_s")) > 1e-5)[[0, -1]]
    position, velocity, friction = (
        whole.column(name)[first : last + 1] for name in ("position_m", "velocity_m_s", "friction_n")
    )
    loops = Loops("tribometer", whole.sample_time_s, position, velocity, friction, _halves(len(position)))
    return _rig([loops], 1e-5)


def _halves(rows: int) -> dict[str, NDArray[np.bool_]]:
    early = np.arange(rows) < rows // 2
    return {IDENTIFIED: early, "later cycles": ~early}


def _rig(loops: list[Loops], least_travel_m: float) -> Rig:
    """Return the rig with first guesses from its own rows: median friction when fast, median slope behind turns."""
    seen = [one for one in loops if IDENTIFIED in one.scored]
    friction, velocity = (
        np.concatenate([getattr(one, name)[one.scored[IDENTIFIED]] for one in seen])
        for name in ("friction_n", "velocity_m_s")
    )
    fast = np.abs(velocity) > 0.5 * np.quantile(np.abs(velocity), 0.95)
    out, back = (float(np.median(np.abs(friction[fast & (sign * velocity > 0.0)]))) for sign in (1.0, -1.0))
    speed = float(np.quantile(np.abs(velocity), 0.95))
    curve = StribeckCurve(out, 1.1 * out, 0.1 * speed, 1.0, 0.02 * out / speed, back / out)
    slopes = [stiffnesses(one.position_m, one.friction_n, least_travel_m) for one in seen]
    return Rig(loops, curve, mean_of_directions(slopes), least_travel_m)


def turns(position_m: Array, least_travel_m: float) -> list[int]:
    """Return the rows at which the motion turns: extremes with at least that much way on both sides."""
    found, extreme, direction = [], 0, 0
    for row, x in enumerate(position_m):
        if direction * (x - position_m[extreme]) >= 0.0 and (direction or abs(x - position_m[0]) > least_travel_m):
            extreme, direction = row, direction or int(math.copysign(1, x - position_m[0]))
        elif direction and abs(x - position_m[extreme]) > least_travel_m:
            found.append(extreme)
            extreme, direction = row, -direction
    return found


def stiffnesses(position_m: Array, friction_n: Array, least_travel_m: float) -> tuple[list[float], list[float]]:
    """Return the slope of force over travel behind each upper turn, and behind each lower one [N/m].

    From 0.8 to 0.2 of the force before the turn; infinite where one row is above 0.8 and the next below 0.2.
    """
    ends = turns(position_m, least_travel_m)
    slopes: tuple[list[float], list[float]] = ([], [])
    for before, turn, after in zip(ends, ends[1:], [*ends[2:], len(position_m)], strict=False):
        way = float(position_m[turn] - position_m[before])
        late = np.abs(position_m[before:turn] - position_m[turn]) < 0.05 * abs(way)
        force = float(np.median(friction_n[before:turn][late]))
        share, travel = friction_n[turn:after] / force, np.abs(position_m[turn:after] - position_m[turn])
        if (share < 0.2).any():
            high, low = max(int(np.argmax(share < 0.8)) - 1, 0), int(np.argmax(share < 0.2))
            jumps = low - high < 2 or travel[low] <= travel[high]
            slope = math.inf if jumps else abs(force) * float((share[high] - share[low]) / (travel[low] - travel[high]))
            slopes[0 if way > 0.0 else 1].append(slope)
    return slopes


def mean_of_directions(slopes: Sequence[tuple[list[float], list[float]]]) -> float:
    """Return the mean of the medians behind upper and lower turns of several stretches [N/m]."""
    behind = [[slope for stretch in slopes for slope in stretch[side]] for side in (0, 1)]
    return float(np.mean([np.median(found) for found in behind]))


def energies(position_m: Array, friction_n: Array, least_travel_m: float) -> list[float]:
    """Return the work of friction over each cycle, from a turn to the next but one [J]."""
    ends = turns(position_m, least_travel_m)
    return [
        float(np.trapezoid(friction_n[first : last + 1], position_m[first : last + 1]))
        for first, last in zip(ends, ends[2:], strict=False)
    ]
