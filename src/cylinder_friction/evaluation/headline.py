"""The ten figures of a comparison that DVC shows and compares."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from cylinder_friction.evaluation.coverage import Coverage, by_condition
from cylinder_friction.evaluation.reported import reported_errors

HEADLINERS = {"paper_hybrid": "paper", "ridge": "ridge", "force_balance_low_pass": "low_pass", "lugre": "lugre"}
"""Estimators with errors in ``metrics.json`` beside the main one, and their names there, which are short because DVC
prints all of them in one line."""


def headline(
    tree: Mapping[str, Mapping[str, Mapping[str, float]]], held: Sequence[Coverage], main: str
) -> dict[str, float | str]:
    """Collect about ten figures of a comparison for DVC: percentages, means over the conditions.

    ``against`` states the reference of errors and bounds: ``truth``, or ``label`` if truth is not known.
    """
    reference, errors = reported_errors(tree[main])
    shown = {main: main} | {name: short for name, short in HEADLINERS.items() if name in tree and name != main}
    own = by_condition(held, reference)
    sessions = [each.held_percent for each in held if (each.reference, each.by) == (reference, "session")]
    content = {
        **{short: float(np.mean(list(reported_errors(tree[name])[1].values()))) for name, short in shown.items()},
        f"{main}_worst": max(errors.values()),
        f"{main}_label": float(np.mean([each["label_percent"] for each in tree[main].values()])),
        "bounds": float(np.mean(list(own.values()))) if own else math.nan,
        "bounds_worst": min(sessions, default=math.nan),
    }
    known = {name: round(value, 3) for name, value in content.items() if math.isfinite(value)}
    return {"against": reference, **known}
