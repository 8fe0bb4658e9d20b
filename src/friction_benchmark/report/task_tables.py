"""A task's figures model by model: errors, where they arise, what an estimate costs and how far it can be trusted."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from cylinder_friction.evaluation.strata import STRATA
from friction_benchmark.report.grid import Cell, table
from friction_benchmark.report.words import (
    NOTHING,
    counted,
    denominator,
    of_size,
    plain,
    seconds,
    share,
    signed,
    within,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from friction_benchmark.report.model_titles import Names
    from friction_benchmark.results import Entry, Interval, TaskResult

EMPTY = Cell(NOTHING, style="none")


def number(value: float, form: Callable[[float], str] = of_size, style: str = "") -> Cell:
    """Return a cell with a number; one that is not finite is an empty cell."""
    return Cell(form(value), value=value, style=style) if math.isfinite(value) else EMPTY


def model_cell(entry: Entry, result: TaskResult, names: Names) -> Cell:
    floor = entry.model == result.baseline
    family = "the floor" if floor else names.family(entry.model)
    return Cell(names.title(entry.model), small=family, style="isfloor" if floor else "")


def margin_cell(below: Interval | None) -> Cell:
    """Return how far a model is below the floor; its colour says whether the interval leaves out zero."""
    if below is None:
        return EMPTY
    style = "good" if below.low > 0.0 else "bad" if below.high < 0.0 else ""
    return Cell(signed(below.value), f"{signed(below.low)} to {signed(below.high)}", below.value, style=style)


def error_table(result: TaskResult, names: Names) -> str:
    """Every measure of error, with 95 % intervals of those that the ranking rests on."""
    extras = list(dict.fromkeys(key for entry in result.entries for key in entry.extras))
    head = ["Model", f"MAE [% of {denominator(result)}]", "MAE [N]", "RMSE [N]", "95th percentile [N]", "bias [N]"]
    head += ["lag [ms]", "below the floor by [points]", *(_extra(key) for key in extras)]
    rows = []
    for entry in result.entries:
        score = entry.score
        rows.append(
            [
                model_cell(entry, result, names),
                Cell(of_size(score.percent.value), within(score.percent), score.percent.value),
                *(number(value) for value in (score.mae_n, score.rmse_n, score.p95_n)),
                number(score.bias_n, signed),
                number(1e3 * score.lag_s, lambda value: f"{value:z.0f}".replace("-", "−")),
                margin_cell(entry.below_baseline),
                *(number(entry.extras.get(key, math.nan)) for key in extras),
            ]
        )
    return table([Cell(words) for words in head], rows)


def _extra(key: str) -> str:
    words, _, unit = key.rpartition("_")
    units = {"n": "N", "percent": "%", "s": "s", "pa": "Pa"}
    return f"{plain(words)} [{units[unit]}]".replace("mae", "MAE") if words and unit in units else plain(key)


def motion_table(result: TaskResult, names: Names) -> str:
    """Percent and newtons by stratum, and percent by test, shaded against the floor of the same column."""
    strata = [name for name in STRATA if any(name in entry.strata for entry in result.entries)]
    tests = sorted({test for entry in result.entries for test in entry.by_condition})
    floor = next((entry for entry in result.entries if entry.model == result.baseline), None)
    rows = []
    for entry in result.entries:
        cells = [model_cell(entry, result, names)]
        for stratum in strata:
            percent, newtons = entry.strata.get(stratum, (math.nan, math.nan))
            base = floor.strata.get(stratum, (math.nan, 0.0))[0] if floor else math.nan
            cells.append(_against(percent, base, f"{of_size(newtons)} N"))
        for test in tests:
            base = floor.by_condition.get(test, math.nan) if floor else math.nan
            cells.append(_against(entry.by_condition.get(test, math.nan), base))
        rows.append(cells)
    head = [Cell("Model"), *(Cell(STRATA[name]) for name in strata), *(Cell(test) for test in tests)]
    groups = [
        ("", 1),
        ("MAE by motion [% of the mean |friction| of its rows]", len(strata)),
        ("by test [%]", len(tests)),
    ]
    return table(head, rows, [group for group in groups if group[1]], "heat")


def _against(percent: float, floor: float, small: str = "") -> Cell:
    if not math.isfinite(percent):
        return EMPTY
    return Cell(of_size(percent), small, percent, against_baseline(percent, floor))


def against_baseline(percent: float, floor: float) -> float | None:
    """Return -1 at half the floor's error or less, 0 at the floor's, 1 at twice it or more."""
    if not (math.isfinite(floor) and floor > 0.0 and percent > 0.0):
        return None
    return max(-1.0, min(1.0, math.log2(percent / floor)))


def cost_table(result: TaskResult, names: Names) -> str:
    """What a step and training cost, and how far bounds and flags can be trusted."""
    head = ["Model", "multiply-adds a step", "time a step [µs]", "training", "coverage of the 90 % bounds"]
    head += ["coverage just after reversals", "coverage of true friction", "mean width of bounds [N]", "rows flagged"]
    head += ["rows out of range", "of those, flagged"]
    rows = []
    for entry in result.entries:
        trust = entry.trust
        cells = [
            model_cell(entry, result, names),
            number(entry.multiply_adds, counted),
            number(entry.step_us),
            number(entry.training_s, seconds),
        ]
        if trust is None:
            cells += [EMPTY] * 7
        else:
            cells += [
                _coverage(trust.coverage.get("", math.nan)),
                _coverage(trust.coverage_after_reversal),
                number(math.nan if trust.coverage_of_truth is None else trust.coverage_of_truth, share),
                number(trust.width_n),
                number(trust.flagged, share),
                number(trust.outside, share),
                number(math.nan if trust.caught is None else trust.caught, share),
            ]
        rows.append(cells)
    return table([Cell(words) for words in head], rows, [("", 1), ("cost", 3), ("trust", 7)])


def _coverage(value: float) -> Cell:
    return number(value, share, style="good" if 0.87 <= value <= 0.93 else "bad")


def residual_table(result: TaskResult, names: Names) -> str:
    """Shape and memory of the residuals and what they still depend on; empty where nobody asked."""
    asked = [(entry, entry.residuals) for entry in result.entries if entry.residuals is not None]
    if not asked:
        return ""
    lags = list(dict.fromkeys(key for _, residuals in asked for key in residuals.autocorrelation))
    inputs = list(dict.fromkeys(key for _, residuals in asked for key in residuals.correlation_with))
    rows = []
    for entry, residuals in asked:
        cells = [model_cell(entry, result, names)]
        cells += [number(residuals.skewness, signed), number(residuals.excess_kurtosis, signed)]
        cells += [_correlation(residuals.autocorrelation.get(lag, math.nan)) for lag in lags]
        cells += [_correlation(residuals.correlation_with.get(name, math.nan)) for name in inputs]
        rows.append(cells)
    head = ["Model", "skewness", "excess kurtosis", *(plain(key) for key in (*lags, *inputs))]
    groups = [("", 1), ("shape", 2), ("autocorrelation at", len(lags)), ("correlation with", len(inputs))]
    return table([Cell(words) for words in head], rows, [group for group in groups if group[1]], "heat")


def _correlation(value: float) -> Cell:
    return Cell(signed(value), value=value, shade=abs(value)) if math.isfinite(value) else EMPTY


def tuning_table(result: TaskResult, names: Names) -> str:
    """What tuning chose for every model, and the validation error it reached; empty where nothing was tuned."""
    rows = []
    for entry in result.entries:
        if entry.tuning:
            chosen = ", ".join(f"{plain(name)} {_value(value)}" for name, value in entry.tuning.items())
            rows.append([model_cell(entry, result, names), Cell(chosen, style="words")])
    return table([Cell("Model"), Cell("chosen", style="words")], rows, sortable=False) if rows else ""


def _value(value: float | int | str) -> str:
    return f"{value:.4g}" if isinstance(value, float) else f"{value}"
