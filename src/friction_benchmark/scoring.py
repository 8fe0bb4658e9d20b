"""From answers to one line of a leaderboard: all seeds' test recordings together, beside the floor's."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.evaluation.bootstrap import block_sums, bootstrap_percent, interval
from cylinder_friction.evaluation.comparison import with_gaps
from cylinder_friction.evaluation.metrics import errors, lag_s
from cylinder_friction.evaluation.residuals import autocorrelation, dependence, residual_figures
from cylinder_friction.evaluation.strata import STRATA, StrataLimits, strata_masks
from cylinder_friction.signals.causal import ExponentialLowPass
from friction_benchmark.results import Entry, Interval, Residuals, Score, Trust

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.evaluation.bootstrap import Array, Mask
    from friction_benchmark.storing import Answer, Estimates
    from friction_benchmark.tasks import Exam
    from friction_benchmark.tuning import Tuned

MEMORY_LAGS_S = (0.005, 0.05, 0.1, 0.5, 1.0)
"""Lags at which the residuals' autocorrelation is told [s]."""
MOST_DIAGNOSED = 36
"""Lag and residuals are told from at most so many recordings, evenly taken: they are means that more would not move."""


@dataclass(frozen=True)
class ScoreSettings:
    """How answers are judged.

    Attributes:
        limits: Where the strata end.
        maximum_lag_s: Shifts tried when looking for an estimate's lag [s].
        bootstrap_repeats: Draws of the block bootstrap.
        bootstrap_block_s: Length of a block [s].
        load_low_pass_s: Time constant of the low-pass of the force balance, from which friction is taken to have the
            load [s].
    """

    limits: StrataLimits
    maximum_lag_s: float = 0.3
    bootstrap_repeats: int = 1000
    bootstrap_block_s: float = 2.0
    load_low_pass_s: float = 0.03


@dataclass(frozen=True, eq=False)
class Paper:
    """One recording, its exam, the answer, and the floor's answer."""

    seed: int
    exam: Exam
    estimate: Estimates
    floor_n: Array | None
    outside: Mask


def entry_of(
    model: str,
    papers: Sequence[Paper],
    answers: Sequence[Answer],
    tuned: Tuned | None,
    cylinder: Cylinder,
    settings: ScoreSettings,
) -> Entry:
    """Return one model's line.

    Args:
        model: Its name.
        papers: Every recording of every seed.
        answers: One a seed, for costs.
        tuned: What was chosen.
        cylinder: For the force balance that loads are taken from.
        settings: How to judge.
    """
    references, estimates, masks = _columns(papers)
    sample_time_s = papers[0].exam.recording.sample_time_s
    diagnosed = papers[:: math.ceil(len(papers) / MOST_DIAGNOSED)]
    rows_a_block = max(1, round(settings.bootstrap_block_s / sample_time_s))
    draws = bootstrap_percent(block_sums(references, estimates, masks, rows_a_block), settings.bootstrap_repeats, 0)
    tests = sorted({paper.exam.recording.metadata.condition for paper in papers})
    steps = [answer.step_us for answer in answers if answer.step_us is not None]
    return Entry(
        model=model,
        score=_score(references, estimates, masks, interval(draws), _lag_s(diagnosed, sample_time_s, settings)),
        seeds={
            str(seed): _percent([paper for paper in papers if paper.seed == seed])
            for seed in sorted({paper.seed for paper in papers})
        },
        by_condition={
            test: _percent([p for p in papers if p.exam.recording.metadata.condition == test]) for test in tests
        },
        strata=_strata(papers, settings.limits),
        below_baseline=_below_floor(papers, draws, rows_a_block, settings),
        trust=_trust(papers, tests, settings.limits),
        residuals=_residuals(diagnosed, sample_time_s),
        multiply_adds=answers[0].multiply_adds,
        step_us=float(np.median(steps)) if steps else 0.0,
        training_s=float(np.median([answer.training_s for answer in answers])),
        tuning=_tuning(tuned),
        extras=_extras(papers, cylinder, settings),
    )


def _columns(papers: Sequence[Paper]) -> tuple[list[Array], list[Array], list[Mask]]:
    """Return references and estimates [N] and usable rows, one array a recording each."""
    return (
        [paper.exam.reference_n for paper in papers],
        [paper.estimate.friction_n for paper in papers],
        [paper.exam.recording.usable() for paper in papers],
    )


def _score(
    references: list[Array],
    estimates: list[Array],
    masks: list[Mask],
    percent_interval: tuple[float, float],
    late_s: float,
) -> Score:
    total = errors(np.concatenate(references), np.concatenate(estimates), np.concatenate(masks))
    return Score(
        percent=Interval(total.percent, *percent_interval),
        mae_n=total.mae_n,
        rmse_n=total.rmse_n,
        p95_n=total.p95_n,
        bias_n=total.bias_n,
        lag_s=late_s,
    )


def _lag_s(papers: Sequence[Paper], sample_time_s: float, settings: ScoreSettings) -> float:
    """Return how late the estimate is [s]; 0 where nothing varies."""
    references, estimates, masks = _columns(papers)
    gap = round(settings.maximum_lag_s / sample_time_s) + 1
    reference, usable = with_gaps(references, masks, gap)
    estimate, _ = with_gaps(estimates, masks, gap)
    return _or_zero(lag_s(reference, estimate, usable, sample_time_s, settings.maximum_lag_s))


def _percent(papers: Sequence[Paper]) -> float:
    error = sum(_abs_error(paper, paper.estimate.friction_n).sum() for paper in papers)
    friction = sum(np.abs(paper.exam.reference_n[paper.exam.recording.usable()]).sum() for paper in papers)
    return float(100.0 * error / friction)


def _abs_error(paper: Paper, estimate_n: Array) -> Array:
    usable = paper.exam.recording.usable()
    return np.asarray(np.abs(estimate_n[usable] - paper.exam.reference_n[usable]))


def _strata(papers: Sequence[Paper], limits: StrataLimits) -> dict[str, tuple[float, float]]:
    """Return percent (of the stratum's own mean |friction|) and MAE [N] of each stratum that has a row."""
    found: dict[str, list[tuple[float, float, int]]] = {stratum: [] for stratum in STRATA}
    for paper in papers:
        usable = paper.exam.recording.usable()
        masks = strata_masks(paper.exam.velocity_m_s, paper.exam.recording.sample_time_s, limits)
        off_n = np.abs(paper.estimate.friction_n - paper.exam.reference_n)
        for stratum, mask in masks.items():
            rows = mask & usable
            found[stratum].append(
                (float(off_n[rows].sum()), float(np.abs(paper.exam.reference_n[rows]).sum()), int(rows.sum()))
            )
    result: dict[str, tuple[float, float]] = {}
    for stratum, parts in found.items():
        off, friction, rows_in_all = (sum(part[place] for part in parts) for place in range(3))
        if rows_in_all and friction > 0.0:
            result[stratum] = (100.0 * off / friction, off / rows_in_all)
    return result


def _below_floor(papers: Sequence[Paper], draws: Array, rows_a_block: int, settings: ScoreSettings) -> Interval | None:
    floors = [paper.floor_n for paper in papers if paper.floor_n is not None]
    if len(floors) != len(papers):
        return None
    references = [paper.exam.reference_n for paper in papers]
    masks = [paper.exam.recording.usable() for paper in papers]
    sums = block_sums(references, floors, masks, rows_a_block)
    ahead = bootstrap_percent(sums, settings.bootstrap_repeats, 0) - draws
    floor_percent = 100.0 * float(sums.abs_error_n.sum() / sums.abs_friction_n.sum())
    return Interval(floor_percent - _percent(papers), *interval(ahead))


def _trust(papers: Sequence[Paper], tests: Sequence[str], limits: StrataLimits) -> Trust:
    held: dict[str, list[NDArray[np.bool_]]] = {test: [] for test in tests}
    after: list[NDArray[np.bool_]] = []
    of_truth: list[NDArray[np.bool_]] = []
    widths: list[Array] = []
    for paper in papers:
        exam, estimate = paper.exam, paper.estimate
        usable = exam.recording.usable()
        inside = estimate.hold(exam.label_n)
        held[exam.recording.metadata.condition].append(inside[usable])
        if exam.true_friction_n is not None:
            of_truth.append(estimate.hold(exam.true_friction_n)[usable])
        masks = strata_masks(exam.velocity_m_s, exam.recording.sample_time_s, limits)
        after.append(inside[usable & masks["after_reversal"]])
        widths.append((estimate.upper_n - estimate.lower_n)[usable])
    coverage = {test: float(np.concatenate(parts).mean()) for test, parts in held.items()}
    coverage[""] = float(np.concatenate([part for parts in held.values() for part in parts]).mean())
    reversals = np.concatenate(after)
    flagged = np.concatenate([paper.estimate.outside for paper in papers])
    outside = np.concatenate([paper.outside for paper in papers])
    return Trust(
        coverage=coverage,
        coverage_after_reversal=float(reversals.mean()) if len(reversals) else coverage[""],
        coverage_of_truth=float(np.concatenate(of_truth).mean()) if of_truth else None,
        width_n=float(np.concatenate(widths).mean()),
        flagged=float(flagged.mean()),
        outside=float(outside.mean()),
        caught=float(flagged[outside].mean()) if outside.any() else None,
    )


def _residuals(papers: Sequence[Paper], sample_time_s: float) -> Residuals:
    references, estimates, masks = _columns(papers)
    lags = [max(1, round(lag / sample_time_s)) for lag in MEMORY_LAGS_S]
    left = [reference - estimate for reference, estimate in zip(references, estimates, strict=True)]
    residual, usable = with_gaps(left, masks, max(lags) + 1)
    figures = residual_figures(residual, usable)
    memory = autocorrelation(residual, usable, max(lags))
    seen: dict[str, list[Array]] = {
        "velocity_m_s": [paper.exam.velocity_m_s for paper in papers],
        "position_m": [paper.exam.recording.column("position_m") for paper in papers],
        "pressure_1_pa": [paper.exam.pressures_pa[:, 0] for paper in papers],
        "pressure_2_pa": [paper.exam.pressures_pa[:, 1] for paper in papers],
    }
    temperatures = [paper.exam.oil_temperature_c for paper in papers if paper.exam.oil_temperature_c is not None]
    if len(temperatures) == len(papers):
        seen["oil_temperature_c"] = temperatures
    flat, rows = np.concatenate(left), np.concatenate(masks)
    related = dependence(flat, rows, {name: np.concatenate(values) for name, values in seen.items()})
    return Residuals(
        skewness=_or_zero(figures.skewness),
        excess_kurtosis=_or_zero(figures.excess_kurtosis),
        autocorrelation={
            f"{lag * sample_time_s:g} s": _or_zero(float(memory[lag])) for lag in lags if lag < len(memory)
        },
        correlation_with=related,
    )


def _extras(papers: Sequence[Paper], cylinder: Cylinder, settings: ScoreSettings) -> dict[str, float]:
    """Return errors against truth where it is known, and errors of the load where there is one."""
    extras: dict[str, float] = {}
    if all(paper.exam.true_friction_n is not None for paper in papers):
        off, friction = 0.0, 0.0
        for paper in papers:
            usable = paper.exam.recording.usable()
            assert paper.exam.true_friction_n is not None
            truth_n = paper.exam.true_friction_n[usable]
            off += float(np.abs(paper.estimate.friction_n[usable] - truth_n).sum())
            friction += float(np.abs(truth_n).sum())
        extras["truth_percent"] = 100.0 * off / friction
    if all(paper.exam.true_load_n is not None for paper in papers):
        extras |= _load_extras(papers, cylinder, settings)
    return extras


def _load_extras(papers: Sequence[Paper], cylinder: Cylinder, settings: ScoreSettings) -> dict[str, float]:
    """Return errors of the virtual load cell: the low-passed force balance less the estimated friction."""
    off, load, rows = 0.0, 0.0, 0
    for paper in papers:
        exam = paper.exam
        usable = exam.recording.usable()
        assert exam.true_load_n is not None
        force_n = exam.pressures_pa @ np.array([cylinder.piston_area_m2, -cylinder.annulus_area_m2])
        smooth_n = low_passed(force_n, exam.recording.sample_time_s, settings.load_low_pass_s)
        estimated_n = smooth_n - paper.estimate.friction_n
        off += float(np.abs(estimated_n - exam.true_load_n)[usable].sum())
        load += float(np.abs(exam.true_load_n[usable]).sum())
        rows += int(usable.sum())
    return {"load_mae_n": off / rows} | ({"load_percent": 100.0 * off / load} if load > 0.0 else {})


def low_passed(values: Array, sample_time_s: float, time_constant_s: float) -> Array:
    low_pass = ExponentialLowPass(1.0 - float(np.exp(-sample_time_s / time_constant_s)))
    return low_pass.advance(low_pass.new_state(), values[:, None])[:, 0]


def _tuning(tuned: Tuned | None) -> dict[str, float | int | str]:
    if tuned is None or tuned.validation_percent is None:
        return {}
    return {**tuned.choice, "validation_percent": tuned.validation_percent}


def _or_zero(value: float) -> float:
    """JSON has no NaN; a residual that never varies has neither shape nor memory."""
    return float(value) if np.isfinite(value) else 0.0
