"""Bounds around an estimate: split conformal prediction within each regime of motion.

The errors of an estimate on recordings that it was not trained on are sorted by regime, and their quantiles become the
bounds (split conformal prediction: Vovk, Gammerman and Shafer 2005; within groups: Vovk, Lindsay, Nouretdinov and
Gammerman 2003, "Mondrian confidence machine"). Errors are against the label. A sensor's offset shifts label and
estimate alike, so errors do not show it; the label's own uncertainty is therefore added if it is stated. The bounds
then hold friction over all sessions. A session with a large offset is held less often: all its rows share the offset.
The regime follows from the causal velocity, so every runtime knows it at once. The limit of standstill follows from the
noise of the recordings' positions, the limit of creep from their speeds. Neighbouring samples are alike, so the
finite-sample guarantee, which needs exchangeable errors, does not hold exactly; coverage is measured on test
recordings.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import ndtr, ndtri, stdtrit

from cylinder_friction.arrays import Array, Mask
from cylinder_friction.machine_code import compiled, compiled_part
from cylinder_friction.realtime.flags import Flag
from cylinder_friction.realtime.model import Bounds
from cylinder_friction.recordings.columns import COVERAGE_FACTOR, SAMPLE_COLUMNS, UNCERTAINTY_COLUMN
from cylinder_friction.recordings.line_loss import LineLoss
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.signals.causal import FirFilter, one_sided_savitzky_golay_taps
from cylinder_friction.signals.noise import sensor_noise
from cylinder_friction.signals.smooth_signals import in_chambers

Whole = NDArray[np.int64]

REGIMES = ("standstill", "creep", "sliding", "reversal")
STANDSTILL, CREEP, SLIDING, REVERSAL = range(4)
CREEP_SHARE = 0.4  # The slowest share of a cylinder's motion, called creep, in which friction falls with velocity
REVERSAL_S = 0.1
PROBABILITY = 0.9
VELOCITY_WINDOW = 21
VELOCITY_ORDER = 2
SMALLEST_DEVIATION_N = 1e-3  # Standard uncertainty of a label that states zero
LEAST_OWN_SHARE = 0.25
"""Smallest share of the squared errors that is attributed to the estimator itself instead of the offset."""
UNKNOWN_N = 1e9  # Distance of uncalibrated bounds: so wide that they state nothing


@dataclass(frozen=True, eq=False)
class LearnedOffset:
    """Uncertainty of one recording's offset, as the estimator learned it, and as its label knows it."""

    deviation_n: Array  # Standard deviation of learned less label's offset at each sample [N], shape ``(n,)``
    label_n: float  # Standard uncertainty of the label's own offset, part of ``friction_uncertainty_n`` [N]


def velocity_taps(sample_time_s: float, inputs: Sequence[str] = SAMPLE_COLUMNS) -> Array:
    """Build the taps, shape ``(inputs, 21)``, of the causal velocity [m/s] that decides the regime."""
    taps = np.zeros((len(inputs), VELOCITY_WINDOW))
    taps[list(inputs).index("position_m")] = one_sided_savitzky_golay_taps(
        VELOCITY_WINDOW, VELOCITY_ORDER, 1, sample_time_s
    )
    return taps


def causal_velocity(recording: Recording) -> Array:
    """Compute the causal velocity that decides the regime [m/s], shape ``(n,)``."""
    taps = velocity_taps(recording.sample_time_s, ("position_m",))
    return FirFilter(taps[None]).run(recording.samples(("position_m",)))[:, 0]


def without_line_loss(recording: Recording, lines: Mapping[str, LineLoss]) -> Recording:
    """Subtract the loss of lines, by pressure, at the causal velocity, as a real-time step does."""
    if not lines:
        return recording
    return in_chambers(recording, lines, causal_velocity(recording)).described(line_loss={})


def regimes_of(recording: Recording, standstill_m_s: float, creep_m_s: float) -> Whole:
    """Find the regime of each row, shape ``(n,)``, as the real-time step does on valid samples."""
    reversal_samples = round(REVERSAL_S / recording.sample_time_s)
    return regimes(causal_velocity(recording), standstill_m_s, creep_m_s, reversal_samples)


def standstill_below_m_s(recordings: Sequence[Recording]) -> float:
    """Measure the standard deviation of the causal velocity's noise [m/s]: the recordings' median, 0 without any."""
    noise_m_s = [
        sensor_noise(each.column("position_m"))
        * float(np.linalg.norm(velocity_taps(each.sample_time_s, ("position_m",))))
        for each in recordings
    ]
    return float(f"{np.median(noise_m_s):.1g}") if noise_m_s else 0.0


def creep_below_m_s(velocities_m_s: Sequence[Array], standstill_m_s: float) -> float:
    """Find the speed below which ``CREEP_SHARE`` of all motion lies [m/s]; without motion the limit of standstill."""
    speed = np.abs(np.concatenate([np.empty(0), *velocities_m_s]))
    moving = speed[speed > standstill_m_s]
    return float(f"{np.quantile(moving, CREEP_SHARE):.3g}") if len(moving) else standstill_m_s


def bounds_count(estimated: Recording) -> Mask:
    """Mark the rows of an estimated recording in which the bounds should hold, shape ``(n,)``.

    These are usable rows with no flag other than ``OUTSIDE`` and ``OFFSET_UNKNOWN``.
    """
    return estimated.usable() & (estimated.columns["flags"] & ~(Flag.OUTSIDE | Flag.OFFSET_UNKNOWN) == 0)


def unknown_bounds(sample_time_s: float) -> Bounds:
    """Make bounds that state nothing, for an estimator that was never calibrated."""
    wide = (UNKNOWN_N,) * len(REGIMES)
    return Bounds(tuple(-each for each in wide), wide, 0.0, 0.0, round(REVERSAL_S / sample_time_s), 1.0)


def calibrated_bounds(
    recordings: Sequence[Recording],
    estimates_n: Sequence[Array],
    sample_time_s: float,
    warm_up_samples: int,
    probability: float = PROBABILITY,
    offsets: Sequence[LearnedOffset] | None = None,
) -> Bounds:
    """Calibrate bounds between which friction lies with ``probability``, with half of the rest on either side.

    With ``offsets``, the bounds widen with the uncertainty of the sensors' offset (``Bounds.spread_n``), and errors
    count in units of their expected deviation (Lei et al. 2018, 5.2). Without ``offsets``, the label's stated
    uncertainty, ``friction_uncertainty_n``, widens them; if a recording lacks it, they hold the label only
    (``Bounds.holds``).

    Args:
        recordings: Labelled recordings that were not trained on; usable rows count, except the first
            ``warm_up_samples``.
        estimates_n: Estimated friction of each recording [N].
        sample_time_s: Sample time [s].
        warm_up_samples: Rows that are left out at each recording's start.
        probability: In (0, 1).
        offsets: Learned offset of each recording; None: the estimator learns none.

    Raises:
        ValueError: The probability is not in (0, 1).
    """
    velocities_m_s = [causal_velocity(each) for each in recordings]
    standstill_m_s = standstill_below_m_s(recordings)
    creep_m_s = creep_below_m_s(velocities_m_s, standstill_m_s)
    stated = bool(recordings) and all(UNCERTAINTY_COLUMN in each.columns for each in recordings)
    reversal_samples = round(REVERSAL_S / sample_time_s)
    errors, deviations, learned = [np.empty(0)], [np.empty(0)], [np.empty(0)]
    regime, sessions = [np.empty(0, dtype=np.int64)], [np.empty(0, dtype=np.int64)]
    names = sorted({recording.metadata.session for recording in recordings})
    for place, (recording, estimate_n) in enumerate(zip(recordings, estimates_n, strict=True)):
        counted = recording.usable().copy()
        counted[:warm_up_samples] = False
        errors.append((recording.column("friction_n") - estimate_n)[counted])
        zero_n = 0.0
        if offsets is not None:
            zero_n = offsets[place].label_n
            learned.append(offsets[place].deviation_n[counted])
        if stated:
            variance = (recording.column(UNCERTAINTY_COLUMN)[counted] / COVERAGE_FACTOR) ** 2
            deviations.append(np.sqrt(np.maximum(variance - zero_n**2, 0.0)))
        sessions.append(np.full(int(counted.sum()), names.index(recording.metadata.session)))
        regime.append(regimes(velocities_m_s[place], standstill_m_s, creep_m_s, reversal_samples)[counted])
    error_n, deviation_n, groups = np.concatenate(errors), np.concatenate(deviations), np.concatenate(regime)
    spread_n = np.zeros(len(REGIMES))
    if offsets is not None:
        spread_n, expected = _spread(error_n, np.concatenate(learned), groups)
        error_n, deviation_n = error_n / expected, deviation_n / expected if stated else deviation_n
    lower, upper = conformal_offsets(error_n, groups, len(REGIMES), probability)
    if stated:
        _widen(lower, upper, error_n, deviation_n, groups, probability)
    further = _further_for_few(error_n, np.concatenate(sessions), probability)
    return Bounds(
        lower_n=tuple((further * lower).tolist()),
        upper_n=tuple((further * upper).tolist()),
        standstill_m_s=standstill_m_s,
        creep_m_s=creep_m_s,
        reversal_samples=reversal_samples,
        probability=probability,
        holds="friction" if stated or offsets is not None else "label",
        spread_n=tuple(spread_n.tolist()),
    )


def _further_for_few(errors_n: Array, sessions: Whole, probability: float) -> float:
    """Compute the factor by which bounds from few sessions are widened, since the next session has its own mean error.

    The spread between sessions is scaled by Student's t instead of the normal quantile; the spread of rows within
    sessions is not scaled. A single session does not show how sessions differ, and leaves the bounds unchanged.
    """
    count = len(np.unique(sessions))
    if count < 2:
        return 1.0
    means = np.array([errors_n[sessions == each].mean() for each in np.unique(sessions)])
    share = min(float(np.var(means, ddof=1) / max(np.mean(errors_n**2), 1e-12)), 1.0)
    side = 1.0 - (1.0 - probability) / 2.0
    ratio = math.sqrt(1.0 + 1.0 / count) * float(stdtrit(count - 1, side) / ndtri(side))
    return math.sqrt(1.0 + share * (ratio**2 - 1.0))


def _spread(errors_n: Array, deviations_n: Array, groups: Whole) -> tuple[Array, Array]:
    """Compute each regime's standard deviation of errors without the offset, and the scale of each error's bound."""
    spread_n, expected = np.zeros(len(REGIMES)), np.ones(len(errors_n))
    for group in range(len(REGIMES)):
        own = groups == group
        if own.any():
            square, offset = float(np.mean(errors_n[own] ** 2)), float(np.mean(deviations_n[own] ** 2))
            spread_n[group] = max(math.sqrt(max(square - offset, LEAST_OWN_SHARE * square)), SMALLEST_DEVIATION_N)
            expected[own] = np.sqrt(1.0 + (deviations_n[own] / spread_n[group]) ** 2)
    return spread_n, expected


def _widen(lower: Array, upper: Array, errors_n: Array, deviations_n: Array, groups: Whole, probability: float) -> None:
    for group in range(len(REGIMES)):
        own = groups == group
        if own.any():
            known = (errors_n[own], deviations_n[own])
            lower[group], upper[group] = _widened(lower[group], upper[group], *known, probability)


def conformal_offsets(errors_n: Array, groups: Whole, count: int, probability: float) -> tuple[Array, Array]:
    """Compute finite-sample quantiles of each group's errors [N], shape ``(count,)`` below and above.

    A group with too few errors gets the quantiles of all errors. If even these are too few, the offsets are so wide
    that they state nothing.

    Args:
        errors_n: Label - estimate, shape ``(n,)``.
        groups: Group of each error, in ``range(count)``, shape ``(n,)``.
        count: Number of groups.
        probability: Probability of an error between the two, with half of the rest on either side; in (0, 1).

    Raises:
        ValueError: The probability is not in (0, 1).
    """
    if not 0.0 < probability < 1.0:
        raise ValueError(f"probability must be in (0, 1), but got {probability!r}")
    side = 1.0 - (1.0 - probability) / 2.0
    every = _finite_sample_quantiles(errors_n, side) or (-UNKNOWN_N, UNKNOWN_N)
    offsets = [_finite_sample_quantiles(errors_n[groups == group], side) or every for group in range(count)]
    lower, upper = np.array(offsets).reshape(-1, 2).T
    return lower, upper


def _finite_sample_quantiles(errors_n: Array, side: float) -> tuple[float, float] | None:
    rank = math.ceil((len(errors_n) + 1) * side)
    if rank > len(errors_n):
        return None
    ordered = np.sort(errors_n)
    return float(ordered[len(errors_n) - rank]), float(ordered[rank - 1])


def _widened(
    lower: float, upper: float, errors_n: Array, deviations_n: Array, probability: float
) -> tuple[float, float]:
    """Compute quantiles of errors after a normal error of its own deviation is added to each [N].

    They are at least as far from the estimate as the quantiles of the errors alone, ``lower`` and ``upper``.
    """
    if upper >= UNKNOWN_N:
        return lower, upper
    deviations_n = np.maximum(deviations_n, SMALLEST_DEVIATION_N)
    side = 1.0 - (1.0 - probability) / 2.0
    furthest = float(np.abs(errors_n).max() + 10.0 * deviations_n.max())

    def excess(at: float, share: float) -> float:
        return float(ndtr((at - errors_n) / deviations_n).mean()) - share

    def quantile(share: float) -> float:
        return float(brentq(excess, -furthest, furthest, (share,), xtol=1e-6))

    return min(lower, quantile(1.0 - side)), max(upper, quantile(side))


@compiled
def regimes(velocity_m_s: Array, standstill_m_s: float, creep_m_s: float, reversal_samples: int) -> NDArray[np.int64]:
    """Find the regime of each step, shape ``(n,)``: see ``next_regime``."""
    result = np.empty(velocity_m_s.shape[0], dtype=np.int64)
    direction, left = 0, 0
    for row in range(velocity_m_s.shape[0]):
        result[row], direction, left = next_regime(
            velocity_m_s[row], direction, left, standstill_m_s, creep_m_s, reversal_samples
        )
    return result


@compiled_part
def next_regime(
    velocity_m_s: float, direction: int, left: int, standstill_m_s: float, creep_m_s: float, reversal_samples: int
) -> tuple[int, int, int]:
    """Advance regime, direction and remaining steps of a reversal by one step.

    Direction is 0 below ``standstill_m_s``, else the velocity's sign. A new direction other than 0 begins a reversal
    (or start) of ``reversal_samples`` steps, this one included, whatever the velocity is in them.
    """
    now = 0
    if velocity_m_s >= standstill_m_s:
        now = 1
    elif velocity_m_s <= -standstill_m_s:
        now = -1
    if now != 0 and now != direction:
        left = reversal_samples
    if left > 0:
        return 3, now, left - 1
    if now == 0:
        return 0, now, left
    if abs(velocity_m_s) < creep_m_s:
        return 1, now, left
    return 2, now, left
