"""The model card of a registered version, in Markdown, for users of the model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from cylinder_friction.evaluation.reported import reported_errors
from cylinder_friction.realtime.guard import TrainingRange
from cylinder_friction.realtime.model import Bounds, Guard, applied, from_json
from cylinder_friction.recordings.channel_correction import ChannelCorrection
from cylinder_friction.recordings.columns import ALL_CONDITIONS
from cylinder_friction.recordings.line_loss import LineLoss
from cylinder_friction.reporting.estimator_titles import title

if TYPE_CHECKING:
    from cylinder_friction.cylinder import Cylinder

_USES = (
    ("train", "{} recordings"),
    ("validation", "{} of other sessions decided when training stopped"),
    ("calibration", "{} of others again calibrated its bounds"),
)
_SHOWN_IN = {"pa": ("bar", 1e-5), "m": ("mm", 1e3), "n": ("N", 1.0), "c": ("°C", 1.0)}
_AGAINST = {"truth": "true friction", "label": "the label, which it was trained on"}


def model_card(
    name: str,
    cylinder: Cylinder,
    description: Mapping[str, Any],
    chosen: Mapping[str, Any],
    recordings: Mapping[str, int],
    conditions: Mapping[str, Mapping[str, float]],
    held: Sequence[Mapping[str, Any]],
) -> str:
    """Write the card of an estimator.

    ``description`` is the content of its ``estimator.json``, ``recordings`` counts its training recordings by role, and
    ``conditions`` and ``held`` are from ``reports/metrics.json`` and ``reports/coverage.json``.
    """
    reference, errors = reported_errors(conditions)
    own = [each for each in held if (each["reference"], each["by"]) == (reference, "condition")]
    shares = {each["group"]: each["held_percent"] for each in own}
    bounds = from_json(Bounds, description.get("bounds"))
    corrections = {column: ChannelCorrection(**own) for column, own in description.get("corrections", {}).items()}
    line_loss = {column: LineLoss(**own) for column, own in description.get("line_loss", {}).items()}
    formulas = applied(description["input"], corrections, line_loss)
    lines = [
        f"{title(name)}: friction inside a hydraulic cylinder [N] from "
        f"{', '.join(f'`{column}`' for column in description['input'])}.",
        "",
        f"- Cylinder: {cylinder.name}, bore {1e3 * cylinder.bore_diameter_m:g} mm, rod "
        f"{1e3 * cylinder.rod_diameter_m:g} mm, "
        + (f"second rod {1e3 * cylinder.rod_diameter_1_m:g} mm, " if cylinder.rod_diameter_1_m else "")
        + f"stroke {1e3 * cylinder.stroke_m:g} mm",
        "- Trained on: " + "; ".join(words.format(recordings[role]) for role, words in _USES if recordings.get(role)),
        *([f"- Hyperparameters: {', '.join(f'{key} {value:.4g}' for key, value in chosen.items())}"] if chosen else []),
        f"- Sampled every {1e3 * description['sample_time_s']:g} ms, late by {1e3 * description['lag_s']:g} ms, "
        f"{description['multiply_adds_a_step']} multiply-adds per sample",
        *([f"- Made of the sensors' readings first: {', '.join(formulas)}"] if formulas else []),
        "",
        f"**Mean absolute errors on held-out recordings, against {_AGAINST[reference]}**",
        "",
        "| condition | error [% of mean friction] | 95 % interval of it | error [N] | rows within the bounds [%] |",
        "|---|---|---|---|---|",
        *(_error_row(condition, reference, conditions[condition], shares) for condition in errors),
        "",
    ]
    if bounds:
        lines += [
            f"Bounds: {bounds.in_words()}"
            + (
                f". They hold {_AGAINST[reference]} in {shares[ALL_CONDITIONS]:.1f} % of all rows."
                if ALL_CONDITIONS in shares
                else "."
            ),
            "",
        ]
    lines += [
        "**Valid range; what lies beyond is flagged**",
        "",
        "| input | from | to | training |",
        "|---|---|---|---|",
    ]
    return "\n".join([*lines, *_range_rows(description)])


def _error_row(condition: str, reference: str, numbers: Mapping[str, float], shares: Mapping[str, float]) -> str:
    percent, low, high, mae_n = (
        numbers.get(f"{reference}_{key}") for key in ("percent", "percent_low", "percent_high", "mae_n")
    )
    interval = "" if low is None or high is None else f"{low:.2f} to {high:.2f}"
    cells = [_rounded(percent, 2), interval, _rounded(mae_n, 1), _rounded(shares.get(condition), 1)]
    return f"| {condition} | {' | '.join(cells)} |"


def _rounded(value: float | None, decimals: int) -> str:
    return "" if value is None else f"{value:.{decimals}f}"


def _range_rows(description: Mapping[str, Any]) -> list[str]:
    """List a row per input: the range without a flag, and the range of training."""
    trained = {column: description["training_range"][column] for column in description["input"]}
    valid = TrainingRange(tuple(trained), *zip(*trained.values(), strict=True)).widened()
    lower, upper = valid.lower, valid.upper
    if guard := from_json(Guard, description.get("guard")):  # a load that position decides ends the range
        lower, upper = guard.trained_lower, guard.trained_upper
    rows = []
    for (column, limits), low, high in zip(trained.items(), lower, upper, strict=True):
        what, _, si_unit = column.rpartition("_")
        unit, factor = _SHOWN_IN.get(si_unit, ("", 1.0))
        known, trained_in = ([f"{factor * end:.4g}" for end in ends] for ends in ((low, high), limits))
        rows.append(f"| {what.replace('_', ' ')} [{unit}] | {' | '.join(known)} | {' to '.join(trained_in)} |")
    return rows
