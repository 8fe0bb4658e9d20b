"""Tables of a comparison: one content for Markdown and for the report."""

import math
from collections.abc import Mapping, Sequence
from functools import partial
from operator import itemgetter
from statistics import fmean
from typing import Any

from cylinder_friction.evaluation.analysis import Analysis
from cylinder_friction.evaluation.comparison import LABEL_ITSELF, Comparison, Scores, mean_percent, points_ahead
from cylinder_friction.evaluation.coverage import Coverage
from cylinder_friction.evaluation.starts import Starts
from cylinder_friction.evaluation.timing import StepTime
from cylinder_friction.reporting.estimator_titles import REFERENCES, phrase, title
from cylinder_friction.reporting.page import Cell, Table
from cylinder_friction.reporting.published import HYPERPARAMETERS, PERCENT_BY_TEST, STEP_SECONDS
from cylinder_friction.reporting.summary import best_reference, leaders, ranked, verdict
from cylinder_friction.tuning.space import RANGES
from cylinder_friction.wording import counted

AUDIT_HEADS = {
    "bias_n": "Bias [N]",
    "mae_n": "MAE [N]",
    "mae_percent": "MAE [% of mean |true friction|]",
    "max_n": "Largest [N]",
    "mean_friction_n": "Mean |true friction| [N]",
    "rows": "Rows",
}


def error_table(
    scores: Scores, conditions: Sequence[str], against: str, notes: Mapping[str, str], published: bool = False
) -> Table:
    """Tabulate Table II: percent of mean |friction| and newtons, by estimator and condition.

    The smallest error of a condition is bold, and so is every error that it is not clearly better than. ``scores`` are
    against the label or the truth, never both; ``against`` names the reference for the head, which also states each
    denominator. ``published`` adds the paper's own rows below, which come from other data.
    """
    names = list(scores)
    head: list[str | Cell] = ["Estimator"]
    for condition in conditions:
        denominator_n = scores[names[0]][condition].errors.mean_abs_friction_n
        head.append(Cell(f"Condition {condition}", f"[% of mean |{against}| = {denominator_n:.0f} N]"))
    best = {condition: leaders(scores, condition) for condition in conditions}
    rows: list[list[str | Cell]] = []
    for name in names:
        found = {condition: scores[name][condition].errors for condition in conditions}
        cells = [
            Cell(f"{each.percent:.2f} % ({each.mae_n:.1f} N)", style="best" if name in best[condition] else "")
            for condition, each in found.items()
        ]
        rows.append([Cell(title(name), f"({notes[name]})") if name in notes else title(name), *cells])
    if published and set(conditions) <= set(PERCENT_BY_TEST):
        for key, words in (("lugre", "Published: LuGre (other data)"), ("hybrid", "Published: hybrid (other data)")):
            rows.append([words, *(f"{PERCENT_BY_TEST[condition][key]:.2f} %" for condition in conditions)])
    return Table(head, rows)


def row_notes(comparison: Comparison) -> dict[str, str]:
    """Collect short notes on estimators by name, above all that one equals the label."""
    return dict(comparison.notes) | dict.fromkeys(comparison.equal_to_label, "equals the label by construction")


def coverage_table(found: Sequence[Coverage]) -> Table:
    """Tabulate how often the bounds hold the label and true friction, by condition."""
    return _coverage_table("Condition", [each for each in found if each.by == "condition"])


def coverage_by_rows(found: Sequence[Coverage]) -> Table:
    """Tabulate the same by session and by kind of motion, the worst first; of true friction, if it is known."""
    known = "truth" if any(each.reference == "truth" for each in found) else "label"
    own = [each for each in found if each.reference == known and each.by != "condition"]
    return _coverage_table("Rows of", sorted(own, key=lambda each: (each.held_percent, each.group)))


def _coverage_table(title: str, found: Sequence[Coverage]) -> Table:
    return Table.of(
        found,
        {
            "Held": lambda each: REFERENCES[each.reference],
            title: lambda each: each.group if each.by in ("condition", "motion") else f"{each.by} {each.group}",
            "Rows": lambda each: f"{each.rows:,}",
            "Share [% of rows]": lambda each: f"{each.held_percent:.1f}",
            "Mean width [N]": lambda each: f"{each.mean_width_n:.1f}",
        },
    )


def start_table(found: Sequence[Starts]) -> Table:
    """Tabulate the gain from an offset that was learned in a session's earlier recording, by condition."""
    against = REFERENCES[found[0].reference] if found else "label"
    share = f"[% of mean |{against}|]"
    return Table.of(
        found,
        {
            "Condition": lambda each: each.condition,
            "Recordings": lambda each: str(each.recordings),
            f"Mean |{against}| [N]": lambda each: f"{each.mean_abs_friction_n:.0f}",
            f"Cold {share}": lambda each: f"{each.cold_percent:.2f}",
            f"Warm {share}": lambda each: f"{each.warm_percent:.2f}",
        },
    )


def offset_table(sessions: Sequence[Mapping[str, Any]]) -> Table:
    """Tabulate the sensors' offset of each session, as stage ``offset`` wrote it."""
    return Table.of(
        sessions,
        {
            "Session": itemgetter("session"),
            "Role": itemgetter("role"),
            "Offset [N]": lambda each: f"{each['offset_n']:z.1f}",
            "Uncertainty [N]": lambda each: f"{each['standard_uncertainty_n']:.1f}",
            "Common to all [N]": lambda each: f"{each['common_uncertainty_n']:.1f}",
            "Stated zeros [N]": lambda each: f"{each['prior_n']:.1f}",
            "Strokes out / in": lambda each: f"{each['strokes_extend']} / {each['strokes_retract']}",
            "Sliding [s]": lambda each: f"{each['sliding_s']:.0f}",
        },
    )


def difference_table(comparison: Comparison, main: str) -> Table:
    """Tabulate by how many percentage points every other estimator is behind ``main``, and whether this is clear."""
    scores, known = best_reference(comparison)
    rows: list[list[str | Cell]] = []
    for name in ranked(scores):
        if name == main:
            continue
        row: list[str | Cell] = [title(name)]
        for condition in known:
            ahead, low, high = points_ahead(scores, main, name, condition)
            style = {"better": "good", "worse": "bad", "level": ""}[verdict(scores, main, name, condition)]
            row.append(Cell(f"{ahead:+z.2f}", _interval(low, high, "+z.2f"), ahead, style=style))
        rows.append(row)
    return Table(["Estimator", *(f"Condition {condition} [points]" for condition in known)], rows)


def detail_table(scores: Scores, condition: str) -> Table:
    """Tabulate every error measure of one condition."""
    head = ["Estimator", "MAE [N]", "RMSE [N]", "bias [N]", "95th percentile [N]", "MAE, % of mean |F|"]
    head += ["95 % interval", "fit [%]", "RMSE, % of range", "lag [ms]"]
    rows = []
    for name, by_condition in scores.items():
        score, found = by_condition[condition], by_condition[condition].errors
        _, low, high = mean_percent(by_condition, [condition])
        numbers = (f"{found.mae_n:.2f}", f"{found.rmse_n:.2f}", f"{found.bias_n:+z.2f}", f"{found.p95_n:.1f}")
        shares = (f"{found.percent:.2f}", _interval(low, high, ".2f"), f"{found.fit_percent:.1f}")
        rows.append([title(name), *numbers, *shares, f"{found.range_nrmse_percent:.2f}", f"{1e3 * score.lag_s:+z.1f}"])
    return Table(head, rows)


def session_table(scores: Scores, conditions: Sequence[str]) -> Table:
    """Tabulate the error in each held-out session [%], and the conditions' mean with its 95 % interval."""
    head: list[str | Cell] = ["Estimator"]
    sessions = next(iter(scores.values()))
    head += [
        Cell(f"Condition {condition}", ", ".join(sessions[condition].sessions.percent)) for condition in conditions
    ]
    rows: list[list[str | Cell]] = []
    for name, by_condition in scores.items():
        mean, low, high = mean_percent(by_condition, conditions)
        each = [
            ", ".join(f"{percent:.2f}" for percent in by_condition[condition].sessions.percent.values())
            for condition in conditions
        ]
        rows.append([title(name), *each, Cell(f"{mean:.2f}", _interval(low, high, ".2f"), mean)])
    return Table([*head, "Mean of the conditions"], rows)


def hyperparameter_table(searched: Mapping[str, Any], best: Mapping[str, Any], chosen: Mapping[str, Any]) -> Table:
    """Tabulate Table I: the searched range, the found value and the used one, beside the published values."""
    return Table.of(
        HYPERPARAMETERS.items(),
        {
            "Hyperparameter": lambda each: each[1][0],
            "Range searched": lambda each: _searched(each[0], searched.get(each[0])),
            "Value found": lambda each: _value(best.get(each[0])),
            "Value used": lambda each: _value(chosen.get(each[0])),
            "Published range": lambda each: each[1][1],
            "Published value": lambda each: each[1][2],
        },
    )


def finals_table(finals: Sequence[Mapping[str, Any]]) -> Table:
    """Tabulate the candidates of the search's finals, the best first, and the spread of their trainings."""
    return Table.of(
        sorted(finals, key=lambda final: fmean(final["errors_n"])),
        {
            "Layers": lambda each: str(each["params"]["layers"]),
            "Nodes": lambda each: str(each["params"]["nodes"]),
            "Error [N]": lambda each: f"{fmean(each['errors_n']):.2f}",
            "Of each training [N]": lambda each: f"{min(each['errors_n']):.2f} to {max(each['errors_n']):.2f}",
            "Multiply-adds": lambda each: f"{each['multiply_adds']:,}",
        },
    )


def cost_table(comparison: Comparison, times: Mapping[str, StepTime]) -> Table:
    """Tabulate Table III: the cost of one estimate."""
    published = {"lugre": f"{1e6 * STEP_SECONDS['lugre']:.0f}", "paper_hybrid": f"{1e6 * STEP_SECONDS['hybrid']:.0f}"}
    rows = []
    for name in comparison.estimators:
        measured = (
            (f"{1e6 * times[name].p50_s:.1f}", f"{1e6 * times[name].p99_s:.1f}")
            if name in times
            else ("not measured",) * 2
        )
        rows.append((title(name), f"{comparison.multiply_adds[name]:,}", *measured, published.get(name, "")))
    head = ("Estimator", "Multiply-adds per step", "Step, median [µs]", "Step, 99th percentile [µs]", "Published [µs]")
    return Table(head, rows)


def residual_shape_table(analysis: Analysis) -> Table:
    """Tabulate the distribution of every estimator's residuals over all conditions."""
    found = analysis.residuals
    return Table.of(
        ranked(analysis.comparison.label),
        {
            "Estimator": title,
            "median [N]": lambda name: f"{found[name].median_n:+z.2f}",
            "quartiles [N]": lambda name: (
                f"{found[name].lower_quartile_n:+z.1f} … {found[name].upper_quartile_n:+z.1f}"
            ),
            "standard deviation [N]": lambda name: f"{found[name].deviation_n:.1f}",
            "skewness": lambda name: f"{found[name].skewness:+z.2f}",
            "excess kurtosis": lambda name: f"{found[name].excess_kurtosis:+z.1f}",
            "Jarque–Bera": lambda name: f"{found[name].jarque_bera:.3g} ({_p_value(found[name].jarque_bera_p)})",
        },
    )


def residual_memory_table(analysis: Analysis) -> Table:
    """Tabulate the autocorrelation of every estimator's residuals, and what they still depend on."""
    found, dependences = analysis.residuals, analysis.dependences

    def dependence(key: str, name: str) -> str:
        return f"{dependences[name][key]:+z.2f}"

    return Table.of(
        ranked(analysis.comparison.label),
        {
            "Estimator": title,
            "autocorrelation, 1 sample": lambda name: f"{found[name].autocorrelation_1:.3f}",
            "Ljung–Box, 10 lags": lambda name: f"{found[name].ljung_box:.3g} ({_p_value(found[name].ljung_box_p)})",
            "rows": lambda name: f"{found[name].rows:,}",
            "effective rows": lambda name: f"{found[name].effective_rows:,.0f}",
            **{f"correlation with {key}": partial(dependence, key) for key in dependences[analysis.main]},
        },
    )


def data_table(comparison: Comparison) -> Table:
    """Tabulate the compared recordings."""
    head = ["Condition", "Held-out recordings", "Minutes", "Usable rows", "Mean |label| [N]"]
    head += ["Mean |true friction| [N]", "Mean speed [mm/s]"]
    rows = []
    for condition in comparison.conditions:
        traces = comparison.of_condition(condition)
        usable = sum(int(trace.usable.sum()) for trace in traces)
        minutes = sum(len(trace.time_s) * trace.sample_time_s for trace in traces) / 60.0
        total = sum(len(trace.time_s) for trace in traces)
        speed = sum(float(abs(trace.velocity_m_s[trace.usable]).sum()) for trace in traces) / usable
        label = comparison.label[comparison.estimators[0]][condition].errors.mean_abs_friction_n
        true = comparison.truth.get(LABEL_ITSELF, {}).get(condition)
        known = f"{true.errors.mean_abs_friction_n:.1f}" if true else "not known"
        counts = (str(len(traces)), f"{minutes:.1f}", f"{usable:,} of {total:,}")
        rows.append((condition, *counts, f"{label:.1f}", known, f"{1e3 * speed:.1f}"))
    return Table(head, rows)


def audit_table(groups: Mapping[tuple[str, ...], Mapping[str, Any]]) -> Table:
    """Tabulate the label audit, one row for each group of numbers, named by its keys."""
    columns = list(dict.fromkeys(key for numbers in groups.values() for key in numbers))
    head = ("", *(AUDIT_HEADS.get(column, column.replace("_", " ")) for column in columns))
    names = [", ".join(keys).replace("_", " ") for keys in groups]
    cells = [[_audited(numbers.get(key)) for key in columns] for numbers in groups.values()]
    return Table(head, [(name, *row) for name, row in zip(names, cells, strict=True)])


def markdown_tables(comparison: Comparison, published: bool = False) -> str:
    """Write Table II as Markdown, against true friction if it is known, and against the label.

    With ``published`` the paper's own rows are below the table against the label, their reference too.
    """
    notes = row_notes(comparison)
    against_label = error_table(comparison.label, comparison.conditions, "label", notes, published).markdown()
    count = counted(comparison.sessions, "held-out session")
    bold = "Bold: the smallest error of each condition, and errors that are not clearly larger."
    if all(len(score.sessions.percent) < 2 for score in comparison.label[comparison.estimators[0]].values()):
        bold = (
            "Bold: the smallest error of a condition. No condition has two held-out sessions, so that nothing shows "
            "whether it is clearly the smallest."
        )
    parts = [f"{count}. {bold}\n"]
    if comparison.truth:
        against_truth = error_table(comparison.truth, comparison.truth_conditions, "true friction", notes).markdown()
        parts += ["Mean absolute error against true friction:\n", against_truth]
    else:
        parts.append("True friction is not known for these recordings.\n")
    parts += ["Mean absolute error against the label, which estimators learn from:\n", against_label]
    return "\n".join(parts + [f"{words}\n" for words in (label_warning(comparison),) if words])


def label_warning(comparison: Comparison) -> str:
    """Explain an error against the label if an estimator equals the label; empty if none does."""
    if not comparison.equal_to_label:
        return ""
    equal = " and ".join(map(phrase, comparison.equal_to_label))
    return (
        f"The label is, sample by sample, what {equal} gives. Whatever can learn that filter has next to no error "
        "against the label; this states nothing about friction."
    )


def _interval(low: float, high: float, digits: str) -> str:
    return "not known" if math.isnan(low) else f"{low:{digits}} to {high:{digits}}"


def _known(value: float | None, digits: str) -> str:
    return "–" if value is None else f"{value:{digits}}"


def _audited(value: Any) -> str:
    return "" if value is None else f"{value:z.2f}" if isinstance(value, float) else str(value)


def _p_value(value: float) -> str:
    return "–" if math.isnan(value) else "p < 0.001" if value < 0.001 else f"p = {value:.3f}"


def _searched(name: str, values: Sequence[Any] | None) -> str:
    if values is None:
        return "not searched"
    return (" to " if name in RANGES else ", ").join(_value(value) for value in values)


def _value(value: Any) -> str:
    return "not recorded" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)
