"""What is known of estimators and of the label beside their errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.estimators.analytical import AnalyticalEstimator
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.evaluation.comparison import LABEL_ITSELF
from cylinder_friction.recordings.columns import LOAD_FORCE

if TYPE_CHECKING:
    from cylinder_friction.estimators.base import FrictionEstimator
    from cylinder_friction.recordings.recording import Recording

LABEL_NOTES = {"moving_average": "off line, late: causal moving averages"}  # Every other method looks ahead
DESIGNED = ("hybrid", "lstm")
DESIGN_NOTES = {"force_balance": "corrects the force balance", "paper": "of the published design"}


def notes_of(
    estimators: Mapping[str, FrictionEstimator], recordings: Sequence[Recording], method: str
) -> dict[str, str]:
    """Collect the notes on estimators and on the label, which stand behind their titles."""
    notes = {LABEL_ITSELF: LABEL_NOTES.get(method, "off line, looks ahead")}
    for name, estimator in estimators.items():
        if isinstance(estimator, HybridEstimator) and name in DESIGNED:
            notes[name] = DESIGN_NOTES[estimator.design]
        elif isinstance(estimator, AnalyticalEstimator) and estimator.condition is not None:
            own = [each for each in recordings if each.metadata.condition == estimator.condition]
            notes[name] = f"identified in condition {estimator.condition}{_load_in_words(own)}"
    return notes


def _load_in_words(recordings: Sequence[Recording]) -> str:
    """State the load on the rod: measured, identified, or from the names; empty if nothing is known."""
    forces_n = [each.column(LOAD_FORCE)[each.usable()] for each in recordings if LOAD_FORCE in each.columns]
    if forces_n:
        all_n = np.concatenate(forces_n)
        return f", under a load of {all_n.min():.0f} to {all_n.max():.0f} N"
    stated = sorted({each.metadata.load for each in recordings} - {""})
    return f", load: {', '.join(stated)}" if stated else ""
