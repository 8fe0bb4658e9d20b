"""From predictions to one line of a leaderboard: all seeds' test recordings together, beside the baseline's."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from cylinder_friction.arrays import Array, Mask
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.evaluation.comparison import with_gaps
from cylinder_friction.evaluation.metrics import errors, lag_s
from cylinder_friction.evaluation.strata import STRATA, StrataLimits, strata_masks
from cylinder_friction.params.section import Count, Positive, Section
from friction_benchmark.bootstrap import block_sums, bootstrap_percent, interval
from friction_benchmark.cache import Estimates, Prediction
from friction_benchmark.cases import EvaluationCase, low_passed
from friction_benchmark.evenly import evenly
from friction_benchmark.results import Entry, Interval, Score, Trust
from friction_benchmark.tuning import Tuned

MOST_DIAGNOSED = 36  # The lag is taken from at most so many recordings, evenly: more would not move it
LOAD_LOW_PASS_S = 0.03
"""Time constant of the low-pass of the force balance, from which friction is subtracted to have the load [s]."""


class ScoreSettings(Section):
    """How predictions are scored."""

    maximum_lag_s: Positive  # Shifts tried when looking for an estimate's lag [s]
    standstill_velocity_m_s: Positive  # At or below this speed the piston counts as at rest [m/s]
    stribeck_velocity_m_s: Positive  # Up to twice this speed a row counts as near zero velocity [m/s]
    reversal_window_s: Positive  # How long a row counts as just after a reversal [s]
    bootstrap_repeats: Count  # Draws of the block bootstrap
    bootstrap_block_s: Positive  # Length of a block [s]

    @property
    def limits(self) -> StrataLimits:
        return StrataLimits(self.standstill_velocity_m_s, 2.0 * self.stribeck_velocity_m_s, self.reversal_window_s)

    def block_rows(self, sample_time_s: float) -> int:
        return max(1, round(self.bootstrap_block_s / sample_time_s))


@dataclass(frozen=True, eq=False)
class ScoredRecording:
    """One recording: its case, the estimates, and the baseline's estimate [N]."""

    seed: int
    case: EvaluationCase
    estimate: Estimates
    baseline_n: Array | None

    @property
    def condition(self) -> str:
        return self.case.recording.metadata.condition

    def strata(self, limits: StrataLimits) -> dict[str, Mask]:
        return strata_masks(self.case.velocity_m_s, self.case.recording.sample_time_s, limits)


def leaderboard_entry(
    model: str,
    recordings: Sequence[ScoredRecording],
    predictions: Sequence[Prediction],
    tuned: Tuned,
    cylinder: Cylinder,
    settings: ScoreSettings,
) -> Entry:
    """Return one model's line, from every recording of every seed, and one prediction per seed for its costs."""
    references, estimates, masks = _columns(recordings)
    sample_time_s = recordings[0].case.recording.sample_time_s
    block_rows = settings.block_rows(sample_time_s)
    draws = bootstrap_percent(block_sums(references, estimates, masks, block_rows), settings.bootstrap_repeats, 0)
    conditions = sorted({one.condition for one in recordings})
    seeds = sorted({one.seed for one in recordings})
    total = errors(np.concatenate(references), np.concatenate(estimates), np.concatenate(masks))
    validated = tuned.validation_percent
    return Entry(
        model=model,
        score=Score(
            percent=Interval(total.percent, *interval(draws)),
            mae_n=total.mae_n,
            rmse_n=total.rmse_n,
            p95_n=total.p95_n,
            bias_n=total.bias_n,
            lag_s=_lag_s(evenly(recordings, MOST_DIAGNOSED), sample_time_s, settings),
        ),
        seeds={str(seed): _percent(one for one in recordings if one.seed == seed) for seed in seeds},
        by_condition={name: _percent(one for one in recordings if one.condition == name) for name in conditions},
        strata=_strata(recordings, settings.limits),
        below_baseline=_below_baseline(recordings, draws, block_rows, settings),
        trust=_trust(recordings, conditions, settings.limits),
        multiply_adds=predictions[0].multiply_adds,
        step_us=float(np.median([prediction.step_us for prediction in predictions])),
        training_s=float(np.median([prediction.training_s for prediction in predictions])),
        tuning={} if validated is None else {**tuned.choice, "validation_percent": validated},
        extras=_extras(recordings, cylinder),
    )


def _columns(recordings: Sequence[ScoredRecording]) -> tuple[list[Array], list[Array], list[Mask]]:
    """Return references and estimates [N] and usable rows, one array per recording each."""
    return (
        [one.case.reference_n for one in recordings],
        [one.estimate.friction_n for one in recordings],
        [one.case.usable for one in recordings],
    )


def _lag_s(recordings: Sequence[ScoredRecording], sample_time_s: float, settings: ScoreSettings) -> float:
    """Return how late the estimate is [s]; 0 where nothing varies."""
    references, estimates, masks = _columns(recordings)
    gap = round(settings.maximum_lag_s / sample_time_s) + 1
    reference, usable = with_gaps(references, masks, gap)
    estimate, _ = with_gaps(estimates, masks, gap)
    late_s = lag_s(reference, estimate, usable, sample_time_s, settings.maximum_lag_s)
    return float(late_s) if np.isfinite(late_s) else 0.0


def _sums(parts: Iterable[tuple[Array, Array, Mask]]) -> tuple[float, float, int]:
    """Return |error| and |reference| over all parts, each estimate, reference and rows that count, and how many."""
    off, size, count = 0.0, 0.0, 0
    for estimate, reference, rows in parts:
        off += float(np.abs(estimate - reference)[rows].sum())
        size += float(np.abs(reference[rows]).sum())
        count += int(rows.sum())
    return off, size, count


def _percent(recordings: Iterable[ScoredRecording]) -> float:
    off, friction, _ = _sums((one.estimate.friction_n, one.case.reference_n, one.case.usable) for one in recordings)
    return 100.0 * off / friction


def _strata(recordings: Sequence[ScoredRecording], limits: StrataLimits) -> dict[str, tuple[float, float]]:
    """Return percent (of the stratum's own mean |friction|) and MAE [N] of each stratum that has a row."""
    masks = [one.strata(limits) for one in recordings]
    result: dict[str, tuple[float, float]] = {}
    for stratum in STRATA:
        off, friction, rows = _sums(
            (one.estimate.friction_n, one.case.reference_n, each[stratum] & one.case.usable)
            for one, each in zip(recordings, masks, strict=True)
        )
        if friction > 0.0:
            result[stratum] = (100.0 * off / friction, off / rows)
    return result


def _below_baseline(
    recordings: Sequence[ScoredRecording], draws: Array, block_rows: int, settings: ScoreSettings
) -> Interval | None:
    baselines = [one.baseline_n for one in recordings if one.baseline_n is not None]
    if len(baselines) != len(recordings):
        return None
    references, _, masks = _columns(recordings)
    sums = block_sums(references, baselines, masks, block_rows)
    ahead = bootstrap_percent(sums, settings.bootstrap_repeats, 0) - draws
    return Interval(sums.percent - _percent(recordings), *interval(ahead))


def _trust(recordings: Sequence[ScoredRecording], conditions: Sequence[str], limits: StrataLimits) -> Trust:
    held: dict[str, list[Mask]] = {condition: [] for condition in conditions}
    after: list[Mask] = []
    of_truth: list[Mask] = []
    widths: list[Array] = []
    for one in recordings:
        case, estimate = one.case, one.estimate
        inside = estimate.hold(case.label_n)
        held[one.condition].append(inside[case.usable])
        if case.true_friction_n is not None:
            of_truth.append(estimate.hold(case.true_friction_n)[case.usable])
        after.append(inside[case.usable & one.strata(limits)["after_reversal"]])
        widths.append((estimate.upper_n - estimate.lower_n)[case.usable])
    coverage = {condition: _mean(parts) for condition, parts in held.items()}
    coverage[""] = _mean([part for parts in held.values() for part in parts])
    return Trust(
        coverage=coverage,
        coverage_after_reversal=_mean(after) if any(map(len, after)) else coverage[""],
        coverage_of_truth=_mean(of_truth) if of_truth else None,
        width_n=_mean(widths),
        flagged=_mean([one.estimate.outside for one in recordings]),
    )


def _mean(parts: Sequence[Array | Mask]) -> float:
    return float(np.concatenate(parts).mean())


def _extras(recordings: Sequence[ScoredRecording], cylinder: Cylinder) -> dict[str, float]:
    """Return errors against truth where it is known, and errors of the load where there is one.

    The load is the virtual load cell's: the low-passed force balance less the estimated friction.
    """
    extras: dict[str, float] = {}
    frictions, loads = [], []
    for one in recordings:
        case, friction_n = one.case, one.estimate.friction_n
        if case.true_friction_n is not None:
            frictions.append((friction_n, case.true_friction_n, case.usable))
        if case.true_load_n is not None:
            force_n = case.pressures_pa @ np.array([cylinder.piston_area_m2, -cylinder.annulus_area_m2])
            smooth_n = low_passed(force_n, case.recording.sample_time_s, LOAD_LOW_PASS_S)
            loads.append((smooth_n - friction_n, case.true_load_n, case.usable))
    if len(frictions) == len(recordings):
        off, friction, _ = _sums(frictions)
        extras["truth_percent"] = 100.0 * off / friction
    if loads:
        off, load, rows = _sums(loads)
        extras["load_mae_n"] = off / rows
        extras |= {"load_percent": 100.0 * off / load} if load > 0.0 else {}
    return extras
