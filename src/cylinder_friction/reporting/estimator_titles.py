"""Titles of the estimators in tables, figures and sentences, and the colours of their families."""

from dataclasses import dataclass

from cylinder_friction.reporting.style import BLACK, BLUE, GREEN, ORANGE, PALE, PINK, QUIET


@dataclass(frozen=True)
class Naming:
    """How an estimator is shown: as a title, within a sentence, and by its family's colour."""

    title: str
    phrase: str
    family: str


_KNOWN = {
    "hybrid": Naming("Hybrid", "the hybrid", "hybrid"),
    "paper_hybrid": Naming("Hybrid as published", "the hybrid as published", "hybrid"),
    "lugre": Naming("LuGre", "LuGre", "friction model"),
    "pressure_lugre": Naming("LuGre, pressure-scaled", "the pressure-scaled LuGre", "friction model"),
    "pressure_lugre_all": Naming(
        "LuGre, pressure-scaled, all conditions",
        "the pressure-scaled LuGre identified in all conditions",
        "friction model",
    ),
    "force_balance_unfiltered": Naming("Force balance, unfiltered", "the unfiltered force balance", "force balance"),
    "force_balance_paper": Naming(
        "Force balance, moving averages", "the force balance with the paper's moving averages", "force balance"
    ),
    "force_balance_low_pass": Naming(
        "Force balance, tuned low-pass", "the tuned low-pass of the force balance", "force balance"
    ),
    "ridge": Naming("Ridge on lagged samples", "ridge on lagged samples", "learned"),
    "random_forest": Naming("Random forest alone", "the random forest alone", "learned"),
    "lstm": Naming("LSTM alone", "the hybrid's LSTM alone", "learned"),
    "paper_lstm": Naming("LSTM alone, as published", "the published LSTM alone", "learned"),
    "label": Naming("Label itself", "the label itself", "label"),
}

REFERENCES = {"label": "label", "truth": "true friction"}
"""References of errors, in words."""

FAMILY_COLOURS = {
    "hybrid": BLUE,
    "friction model": ORANGE,
    "force balance": GREEN,
    "learned": PINK,
    "other": QUIET,
    "label": BLACK,
}

TRACE_COLOURS = {"estimate": BLUE, "label": PALE, "truth": BLACK, "hybrid": BLUE, "lugre": ORANGE}
"""Colours of lines over time and velocity: the label is a broad grey band behind the others."""


def naming(estimator: str) -> Naming:
    """Look up how an estimator is shown; an unknown one keeps its own name."""
    words = estimator.replace("_", " ")
    return _KNOWN.get(estimator, Naming(words, words, "other"))


def title(estimator: str) -> str:
    return naming(estimator).title


def phrase(estimator: str) -> str:
    return naming(estimator).phrase


def colour(estimator: str) -> str:
    return FAMILY_COLOURS[naming(estimator).family]
