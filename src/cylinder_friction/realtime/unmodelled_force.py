"""The range of the force balance in training: a balance outside it means a force that the estimator does not know.

Such a force is an external load, an end stop, or a wrong pressure. While the piston slides, friction opposes the motion
and grows with the pressures on the seals: along the motion, the balance lies between two lines over the sum of both
pressures. In creep, at rest and just after a reversal a third line limits its size. The lines enclose the usable rows
of training as measured, the sensors' zeros included, so the flag does not depend on the learned offset. An unmodelled
force is assumed to remain until the piston has moved for ``CLEAR_S`` with the balance between the first two lines,
since nothing refutes it at rest.

Pressures that are all zero, or in bar, balance at rest. Therefore their sum, too, must reach a share of the least sum
of training.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import minimize_scalar

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.machine_code import compiled_part
from cylinder_friction.realtime.bounds import CREEP, SLIDING, causal_velocity, regimes_of
from cylinder_friction.realtime.guard import TRAINED_MARGIN
from cylinder_friction.realtime.model import Bounds, Guard, StepModel
from cylinder_friction.recordings.columns import LOAD_FORCE, PRESSURE_1, PRESSURE_2, PRESSURES
from cylinder_friction.recordings.recording import Recording

CLEAR_S = 1.0
LEAST_PRESSURE_SHARE = 0.5
ZERO_DEVIATIONS = 3.0
"""Standard uncertainties of the sensors' stated zeros by which the lines are widened, besides ``TRAINED_MARGIN`` of the
largest force."""


def balance_weights(cylinder: Cylinder, channels: Sequence[str]) -> tuple[float, ...]:
    """Compute the change of the force balance P1·A1 - P2·A2 - F_load per unit of each channel [N]."""
    weights = {PRESSURE_1: cylinder.piston_area_m2, PRESSURE_2: -cylinder.annulus_area_m2, LOAD_FORCE: -1.0}
    return tuple(float(weights.get(name, 0.0)) for name in channels)


def with_force_limits(
    guard: Guard, bounds: Bounds, cylinder: Cylinder, recordings: Sequence[Recording], channels: Sequence[str]
) -> Guard:
    """Add the range of the force balance in the usable rows of training to a guard.

    Without a raw pressure among the channels, or without usable rows, the guard stays as it is.

    Args:
        guard: The other limits of a sample.
        bounds: Bounds, whose velocities define sliding.
        cylinder: Its areas.
        recordings: Recordings of training, as measured.
        channels: Columns of a sample, and a load that position decides.
    """
    weights = np.array(balance_weights(cylinder, channels))
    used = recordings if set(PRESSURES) <= set(channels) else ()
    parts = [np.empty((3, 0)), *(_usable_rows(each, bounds, weights, channels) for each in used)]
    force_n, direction, pressure_pa = np.concatenate(parts, axis=1)
    if not len(force_n):
        return guard
    size_n, slides, least_pa = np.abs(force_n), direction != 0.0, float(pressure_pa.min())
    along_n, pushed_pa = (direction * force_n)[slides], pressure_pa[slides]
    zero_n = max(_zero_of(each, weights, channels) for each in used)
    zero_pa = max(_zero_of(each, np.isin(channels, PRESSURES).astype(np.float64), channels) for each in used)
    margin_n = TRAINED_MARGIN * float(size_n.max()) + ZERO_DEVIATIONS * zero_n
    largest = _line_above(pressure_pa, size_n, margin_n)
    upper, lower = (
        _line_above(pushed_pa, sign * along_n, margin_n) if slides.any() else largest for sign in (1.0, -1.0)
    )
    return replace(
        guard,
        force_weights=tuple(weights.tolist()),
        sliding_lower=(-lower[0], -lower[1]),
        sliding_upper=upper,
        largest_force=largest,
        clear_samples=round(CLEAR_S / recordings[0].sample_time_s),
        least_pressure_pa=least_pa - (1.0 - LEAST_PRESSURE_SHARE) * abs(least_pa) - ZERO_DEVIATIONS * zero_pa,
    )


def force_limits(model: StepModel) -> Array:
    """Pack the limits of ``unmodelled_force``, shape ``(2, channels + 3)``; ``(2, 0)`` if the range is unknown.

    The rows hold the weights of each channel in the force balance [N] and in the sum of the raw pressures [Pa], then
    constant [N] and slope [N/Pa] of the three lines: lower and upper one while sliding, largest size otherwise.
    """
    guard = model.guard
    if not guard.force_weights:
        return np.zeros((2, 0))
    pressures = np.isin(np.arange(len(model.channels)), model.pressures).astype(np.float64)
    lines = np.transpose([guard.sliding_lower, guard.sliding_upper, guard.largest_force])
    return np.concatenate([[guard.force_weights, pressures], lines], axis=1)


@compiled_part
def unmodelled_force(
    limits: Array, sample: Array, regime: int, direction: int, left: int, clear_samples: int, least_pressure_pa: float
) -> tuple[bool, int]:
    """Check for an unmodelled force; return also the samples of motion after which it no longer counts.

    Args:
        limits: From ``force_limits``, not empty.
        sample: One number per channel, with held values in place of invalid ones.
        regime: Regime of motion, see ``bounds.next_regime``.
        direction: Direction of motion: -1 or 1; 0 at rest.
        left: The second result at the sample before; 0 at the first.
        clear_samples: Samples of motion within the limits that refute the force.
        least_pressure_pa: Least sum of the raw pressures of a working cylinder [Pa].
    """
    force_n, pressure_pa = 0.0, 0.0
    for channel in range(sample.shape[0]):
        force_n += limits[0, channel] * sample[channel]
        pressure_pa += limits[1, channel] * sample[channel]
    lines, along_n = limits[:, sample.shape[0] :], direction * force_n
    within = lines[0, 0] + lines[1, 0] * pressure_pa <= along_n and along_n <= lines[0, 1] + lines[1, 1] * pressure_pa
    if not within if regime == SLIDING else abs(force_n) > lines[0, 2] + lines[1, 2] * pressure_pa:
        return True, clear_samples
    if left > 0 and within and regime in (CREEP, SLIDING):
        return True, left - 1
    return left > 0 or pressure_pa < least_pressure_pa, left


def _usable_rows(recording: Recording, bounds: Bounds, weights: Array, channels: Sequence[str]) -> Array:
    """Collect force balance [N], direction of sliding (0 otherwise) and sum of pressures [Pa], shape ``(3, n)``."""
    slides = regimes_of(recording, bounds.standstill_m_s, bounds.creep_m_s) == SLIDING
    direction = np.where(slides, np.sign(causal_velocity(recording)), 0.0)
    pressure_pa = recording.samples(PRESSURES).sum(axis=1)
    return np.stack([recording.samples(channels) @ weights, direction, pressure_pa])[:, recording.usable()]


def _zero_of(recording: Recording, weights: Array, channels: Sequence[str]) -> float:
    """Compute the standard uncertainty of a weighted sum from the sensors' stated zeros; 0 if none is stated."""
    stated = recording.metadata.uncertainty
    return math.hypot(
        *(weight * stated[name].zero for name, weight in zip(channels, weights, strict=True) if name in stated)
    )


def _line_above(pressure_pa: Array, force_n: Array, margin_n: float) -> tuple[float, float]:
    """Fit the lowest line that lies a margin above all forces; return its constant and slope."""

    mean_pa, steepest = float(pressure_pa.mean()), float(np.abs(force_n).max() / max(pressure_pa.std(), 1.0))

    def above(slope: float) -> float:
        return float((force_n - slope * (pressure_pa - mean_pa)).max())

    slope = float(
        minimize_scalar(above, bounds=(-steepest, steepest), method="bounded", options={"xatol": 1e-4 * steepest}).x
    )
    return above(slope) - slope * mean_pa + margin_n, slope
