"""Tables of one leaderboard: errors, where they arise, the cost of an estimate and how far it can be trusted."""

import math
from collections.abc import Callable

from cylinder_friction.evaluation.strata import STRATA
from cylinder_friction.reporting.page import NONE, Cell, Table
from friction_benchmark.report.model_titles import ModelTitles
from friction_benchmark.report.words import counted, denominator, of_size, plain, seconds, share, signed, within
from friction_benchmark.results import Entry, Interval, TaskResult


def number(value: float, form: Callable[[float], str] = of_size, style: str = "") -> Cell:
    """Return a cell with a number; one that is not finite is an empty cell."""
    return Cell(form(value), value=value, style=style) if math.isfinite(value) else NONE


def model_cell(entry: Entry, result: TaskResult, titles: ModelTitles) -> Cell:
    baseline = entry.model == result.baseline
    family = "the baseline" if baseline else titles.family(entry.model)
    return Cell(titles(entry.model), small=family, style="isbaseline" if baseline else "")


def margin_cell(below: Interval | None) -> Cell:
    """Return how far a model is below the baseline, coloured where the interval leaves out zero."""
    if below is None:
        return NONE
    style = "good" if below.low > 0.0 else "bad" if below.high < 0.0 else ""
    return Cell(signed(below.value), f"{signed(below.low)} to {signed(below.high)}", below.value, style=style)


def error_table(result: TaskResult, titles: ModelTitles) -> Table:
    """Return every measure of error, with 95 % intervals of those that the ranking rests on."""
    extras = sorted({key for entry in result.entries for key in entry.extras})
    head = ["Model", f"MAE [% of {denominator(result)}]", "MAE [N]", "RMSE [N]", "95th percentile [N]", "bias [N]"]
    head += ["lag [ms]", "below the baseline by [points]", *(_extra(key) for key in extras)]
    rows = []
    for entry in result.entries:
        score = entry.score
        cells = [model_cell(entry, result, titles)]
        cells += [Cell(of_size(score.percent.value), within(score.percent), score.percent.value)]
        cells += [number(value) for value in (score.mae_n, score.rmse_n, score.p95_n)]
        cells += [number(score.bias_n, signed)]
        cells += [number(1e3 * score.lag_s, lambda value: f"{value:z.0f}".replace("-", "−"))]
        cells += [margin_cell(entry.below_baseline)]
        rows.append(cells + [number(entry.extras.get(key, math.nan)) for key in extras])
    return Table(head, rows, sortable=True)


def _extra(key: str) -> str:
    words, _, unit = key.rpartition("_")
    units = {"n": "N", "percent": "%", "s": "s", "pa": "Pa"}
    return f"{plain(words)} [{units[unit]}]".replace("mae", "MAE") if words and unit in units else plain(key)


def motion_table(result: TaskResult, titles: ModelTitles) -> Table:
    """Return percent and newtons by stratum, and percent by condition, shaded against the column's baseline."""
    strata = [name for name in STRATA if any(name in entry.strata for entry in result.entries)]
    conditions = sorted({condition for entry in result.entries for condition in entry.by_condition})
    baseline = result.entry_of(result.baseline)
    nothing = (math.nan, math.nan)
    rows = []
    for entry in result.entries:
        cells = [model_cell(entry, result, titles)]
        for stratum in strata:
            percent, newtons = entry.strata.get(stratum, nothing)
            base = baseline.strata.get(stratum, nothing)[0] if baseline else math.nan
            cells.append(_against(percent, base, f"{of_size(newtons)} N"))
        for condition in conditions:
            base = baseline.by_condition.get(condition, math.nan) if baseline else math.nan
            cells.append(_against(entry.by_condition.get(condition, math.nan), base))
        rows.append(cells)
    by_motion = "MAE by motion [% of the mean |friction| of its rows]"
    groups = [("", 1), (by_motion, len(strata)), ("by condition [%]", len(conditions))]
    head = ["Model", *(STRATA[name] for name in strata), *conditions]
    return Table(head, rows, groups=[group for group in groups if group[1]], style="heat", sortable=True)


def _against(percent: float, baseline: float, small: str = "") -> Cell:
    if not math.isfinite(percent):
        return NONE
    return Cell(of_size(percent), small, percent, against_baseline(percent, baseline))


def against_baseline(percent: float, baseline: float) -> float | None:
    """Return -1 at half the baseline's error or less, 0 at the baseline's, 1 at twice it or more."""
    if not (math.isfinite(baseline) and baseline > 0.0 and math.isfinite(percent) and percent > 0.0):
        return None
    return max(-1.0, min(1.0, math.log2(percent / baseline)))


def cost_table(result: TaskResult, titles: ModelTitles) -> Table:
    """Return the cost of a step and of training, and how far bounds and flags can be trusted."""
    conditions = sorted({name for entry in result.entries for name in entry.trust.coverage if name})
    costs = ["multiply-adds per sample", "time per sample [µs]", "training"]
    covered = ["all labels", *conditions, "after reversals", "true friction"]
    rows = []
    for entry in result.entries:
        trust = entry.trust
        cells = [model_cell(entry, result, titles), number(entry.multiply_adds, counted)]
        cells += [number(entry.step_us), number(entry.training_s, seconds)]
        cells += [_coverage(trust.coverage.get(name, math.nan)) for name in ("", *conditions)]
        cells += [_coverage(trust.coverage_after_reversal)]
        cells += [number(math.nan if trust.coverage_of_truth is None else trust.coverage_of_truth, share)]
        rows.append([*cells, number(trust.width_n), number(trust.flagged, share)])
    groups = [("", 1), ("cost", len(costs)), ("coverage of the 90 % bounds", len(covered)), ("", 2)]
    head = ["Model", *costs, *covered, "mean width of bounds [N]", "rows flagged"]
    return Table(head, rows, groups=groups, sortable=True)


def _coverage(value: float) -> Cell:
    return number(value, share, style="good" if 0.87 <= value <= 0.93 else "bad")


def tuning_table(result: TaskResult, titles: ModelTitles) -> Table | None:
    """Return the tuned choices of every model and the validation error reached; None where nothing was tuned."""
    rows: list[list[str | Cell]] = []
    for entry in result.entries:
        if entry.tuning:
            chosen = ", ".join(f"{plain(name)} {_value(value)}" for name, value in sorted(entry.tuning.items()))
            rows.append([model_cell(entry, result, titles), chosen])
    return Table(["Model", "chosen"], rows, words=(1,)) if rows else None


def _value(value: float | int | str) -> str:
    return f"{value:.4g}" if isinstance(value, float) else f"{value}"
