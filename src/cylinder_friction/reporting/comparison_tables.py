"""Tables of the comparison as text: one content for Markdown and for the report."""

from __future__ import annotations

import html
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from cylinder_friction.evaluation.comparison import LABEL_ITSELF
from cylinder_friction.reporting.estimator_titles import title
from cylinder_friction.reporting.published import HYPERPARAMETERS, PERCENT_BY_TEST, STEP_SECONDS
from cylinder_friction.reporting.summary import winner

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from cylinder_friction.evaluation.analysis import Analysis
    from cylinder_friction.evaluation.comparison import Comparison, Scores
    from cylinder_friction.evaluation.timing import StepTime


@dataclass(frozen=True)
class Table:
    """Rows of text under a head; ``best`` holds (row, column) of the cells to stand out."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    best: frozenset[tuple[int, int]] = frozenset()

    def markdown(self) -> str:
        lines = ["| " + " | ".join(self.head) + " |", "|---|" + "---:|" * (len(self.head) - 1)]
        for row_index, row in enumerate(self.rows):
            cells = [f"**{cell}**" if (row_index, column) in self.best else cell for column, cell in enumerate(row)]
            lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
        lines[0] = "| " + " | ".join(cell.replace("|", "\\|") for cell in self.head) + " |"
        return "\n".join(lines) + "\n"

    def html(self) -> str:
        head = "".join(f"<th>{html.escape(cell)}</th>" for cell in self.head)
        body = []
        for row_index, row in enumerate(self.rows):
            cells = "".join(
                f'<td class="best">{html.escape(cell)}</td>'
                if (row_index, column) in self.best
                else f"<td>{html.escape(cell)}</td>"
                for column, cell in enumerate(row)
            )
            body.append(f"<tr>{cells}</tr>")
        return f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>{"".join(body)}</tbody></table></div>'


def error_table(scores: Scores, conditions: Sequence[str], against: str, published: bool = False) -> Table:
    """Table II: percent of mean |friction| and newtons, by estimator and test; the smallest of a test stands out.

    Args:
        scores: Against the label or against the truth, never both.
        tests: Columns.
        against: ``label`` or ``true friction``, for the head, which also states each denominator.
        published: Whether the paper's own rows are added below; they come from other data.
    """
    names = list(scores)
    denominators = {condition: scores[names[0]][condition].errors.mean_abs_friction_n for condition in conditions}
    head = (
        "Estimator",
        *(
            f"condition {condition} [% of mean |{against}| = {denominators[condition]:.0f} N]"
            for condition in conditions
        ),
    )
    rows = [
        (title(name), *(_percent_and_newtons(scores, name, condition) for condition in conditions)) for name in names
    ]
    best = {(names.index(winner(scores, condition)), column + 1) for column, condition in enumerate(conditions)}
    if published and set(conditions) <= set(PERCENT_BY_TEST):
        for key, words in (("lugre", "Published: LuGre (other data)"), ("hybrid", "Published: hybrid (other data)")):
            rows.append((words, *(f"{PERCENT_BY_TEST[condition][key]:.2f} %" for condition in conditions)))
    return Table(head, tuple(rows), frozenset(best))


def detail_table(scores: Scores, condition: str) -> Table:
    """Every error measure of one test."""
    head = (
        "Estimator",
        "MAE [N]",
        "RMSE [N]",
        "bias [N]",
        "95th percentile [N]",
        "MAE, % of mean |F|",
        "95 % interval",
        "fit [%]",
        "RMSE, % of range",
        "lag [ms]",
    )
    rows = []
    for name, by_condition in scores.items():
        score = by_condition[condition]
        found = score.errors
        low, high = score.interval_percent
        rows.append(
            (
                title(name),
                f"{found.mae_n:.2f}",
                f"{found.rmse_n:.2f}",
                f"{found.bias_n:+.2f}",
                f"{found.p95_n:.1f}",
                f"{found.percent:.2f}",
                f"{low:.2f} – {high:.2f}",
                f"{found.fit_percent:.1f}",
                f"{found.range_nrmse_percent:.2f}",
                f"{1e3 * score.lag_s:+.1f}",
            )
        )
    return Table(head, tuple(rows))


def hyperparameter_table(searched: Mapping[str, Any], chosen: Mapping[str, Any]) -> Table:
    """Table I: the range searched and the value used, beside the published ones."""
    words = {
        "layers": "LSTM layers",
        "nodes": "LSTM nodes a layer",
        "dropout": "Dropout",
        "learning_rate": "Learning rate",
        "forest_trees": "Forest: trees",
        "forest_depth": "Forest: greatest depth",
    }
    rows = []
    for key, name in words.items():
        published_range, published_value = HYPERPARAMETERS[key]
        rows.append((name, _range(searched.get(key)), _value(chosen.get(key)), published_range, published_value))
    return Table(("Hyperparameter", "Range searched", "Value used", "Published range", "Published value"), tuple(rows))


def cost_table(comparison: Comparison, times: Mapping[str, StepTime]) -> Table:
    """Table III: what one estimate costs."""
    rows = []
    for name in comparison.estimators:
        time = times.get(name)
        published = f"{1e6 * STEP_SECONDS[key]:.0f}" if (key := _published_key(name)) else ""
        rows.append(
            (
                title(name),
                f"{comparison.multiply_adds[name]:,}",
                f"{1e6 * time.p50_s:.1f}" if time else "not measured",
                f"{1e6 * time.p99_s:.1f}" if time else "not measured",
                published,
            )
        )
    head = ("Estimator", "Multiply-adds a step", "Step, median [µs]", "Step, 99th percentile [µs]", "Published [µs]")
    return Table(head, tuple(rows))


def residual_shape_table(analysis: Analysis) -> Table:
    """How the residuals of every estimator are distributed, over all tests."""
    head = (
        "Estimator",
        "median [N]",
        "quartiles [N]",
        "standard deviation [N]",
        "skewness",
        "excess kurtosis",
        "Jarque–Bera",
    )
    rows = tuple(
        (
            title(name),
            f"{found.median_n:+.2f}",
            f"{found.lower_quartile_n:+.1f} … {found.upper_quartile_n:+.1f}",
            f"{found.deviation_n:.1f}",
            f"{found.skewness:+.2f}",
            f"{found.excess_kurtosis:+.1f}",
            f"{found.jarque_bera:.3g} ({_p_value(found.jarque_bera_p)})",
        )
        for name, found in analysis.residuals.items()
    )
    return Table(head, rows)


def residual_memory_table(analysis: Analysis) -> Table:
    """What the residuals of every estimator remember, and what they still depend on, over all tests."""
    inputs = list(analysis.dependences[analysis.main])
    head = (
        "Estimator",
        "autocorrelation, 1 sample",
        "Ljung–Box, 10 lags",
        "rows",
        "effective rows",
        *(f"correlation with {name}" for name in inputs),
    )
    rows = tuple(
        (
            title(name),
            f"{found.autocorrelation_1:.3f}",
            f"{found.ljung_box:.3g} ({_p_value(found.ljung_box_p)})",
            f"{found.rows:,}",
            f"{found.effective_rows:,.0f}",
            *(f"{analysis.dependences[name][key]:+.2f}" for key in inputs),
        )
        for name, found in analysis.residuals.items()
    )
    return Table(head, rows)


def data_table(comparison: Comparison) -> Table:
    """What was compared on."""
    head = (
        "Test",
        "Held-out recordings",
        "Minutes",
        "Usable rows",
        "Mean |label| [N]",
        "Mean |true friction| [N]",
        "Mean speed [mm/s]",
    )
    rows = []
    for condition in comparison.conditions:
        traces = comparison.of_condition(condition)
        usable = sum(int(trace.usable.sum()) for trace in traces)
        minutes = sum(len(trace.time_s) * trace.sample_time_s for trace in traces) / 60.0
        total = sum(len(trace.time_s) for trace in traces)
        speed = sum(float(abs(trace.velocity_m_s[trace.usable]).sum()) for trace in traces) / usable
        name = comparison.estimators[0]
        true = comparison.truth.get(LABEL_ITSELF, {}).get(condition)
        rows.append(
            (
                condition,
                str(len(traces)),
                f"{minutes:.1f}",
                f"{usable:,} of {total:,}",
                f"{comparison.label[name][condition].errors.mean_abs_friction_n:.1f}",
                f"{true.errors.mean_abs_friction_n:.1f}" if true else "not known",
                f"{1e3 * speed:.1f}",
            )
        )
    return Table(head, tuple(rows))


def markdown_tables(comparison: Comparison) -> str:
    """Return Table II against the label and, where it is known, against true friction, as Markdown."""
    against_label = error_table(comparison.label, comparison.conditions, "label").markdown()
    parts = ["Mean absolute error against the label:\n", against_label]
    if comparison.truth:
        conditions = [condition for condition in comparison.conditions if condition in comparison.truth[LABEL_ITSELF]]
        against_truth = error_table(comparison.truth, conditions, "true friction").markdown()
        parts += ["Mean absolute error against true friction:\n", against_truth]
    else:
        parts.append("True friction is not known for these recordings.\n")
    return "\n".join(parts)


def _percent_and_newtons(scores: Scores, name: str, condition: str) -> str:
    found = scores[name][condition].errors
    return f"{found.percent:.2f} % ({found.mae_n:.1f} N)"


def _p_value(value: float) -> str:
    return "p < 0.001" if value < 0.001 else f"p = {value:.3f}"


def _published_key(name: str) -> str | None:
    return {"lugre": "lugre", "paper_hybrid": "hybrid"}.get(name)


def _range(searched: Any) -> str:
    if searched is None:
        return "not searched"
    if isinstance(searched, tuple):
        return f"{_value(searched[0])} to {_value(searched[1])}"
    return ", ".join(_value(choice) for choice in searched)


def _value(value: Any) -> str:
    if value is None:
        return "not recorded"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
