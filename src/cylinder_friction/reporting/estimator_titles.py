"""What an estimator is called in tables, figures and sentences, and which family it belongs to."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Naming:
    """How an estimator is shown: as a title, within a sentence, and by its family's colour."""

    title: str
    phrase: str
    family: str


_KNOWN = {
    "hybrid": Naming("Hybrid (corrects the force balance)", "the hybrid", "hybrid"),
    "paper_hybrid": Naming("Hybrid as published", "the hybrid as published", "hybrid"),
    "lugre": Naming("LuGre (identified at no load)", "LuGre", "friction model"),
    "pressure_lugre": Naming("LuGre, pressure-scaled", "the pressure-scaled LuGre", "friction model"),
    "force_balance_unfiltered": Naming("Force balance, unfiltered", "the unfiltered force balance", "force balance"),
    "force_balance_paper": Naming(
        "Force balance, moving averages", "the force balance with the paper's moving averages", "force balance"
    ),
    "force_balance_low_pass": Naming(
        "Force balance, tuned low-pass", "the tuned low-pass of the force balance", "force balance"
    ),
    "ridge": Naming("Ridge on lagged samples", "ridge on lagged samples", "learned"),
    "random_forest": Naming("Random forest alone", "the random forest alone", "learned"),
    "lstm": Naming("LSTM alone (corrects the force balance)", "the hybrid's LSTM alone", "learned"),
    "paper_lstm": Naming("LSTM alone, as published", "the published LSTM alone", "learned"),
    "label": Naming("Label itself (off line, looks ahead)", "the label itself", "label"),
}

FAMILY_COLOURS = {
    "hybrid": "#0072B2",
    "friction model": "#D55E00",
    "force balance": "#009E73",
    "learned": "#CC79A7",
    "other": "#7F7F7F",
    "label": "#000000",
}
"""From the colour-blind-safe palette of Okabe and Ito (2008)."""

TRACE_COLOURS = {"label": "#A6ADB4", "truth": "#000000", "hybrid": "#0072B2", "lugre": "#D55E00"}
"""Lines over time and velocity: the label is a broad grey band behind what is compared with it."""


def naming(estimator: str) -> Naming:
    """Return how an estimator is shown; one the project does not know keeps its own name."""
    words = estimator.replace("_", " ")
    return _KNOWN.get(estimator, Naming(words, words, "other"))


def title(estimator: str) -> str:
    return naming(estimator).title


def phrase(estimator: str) -> str:
    return naming(estimator).phrase


def sentence_start(words: str) -> str:
    """Return the words with their first letter large."""
    return words[:1].upper() + words[1:]


def colour(estimator: str) -> str:
    return FAMILY_COLOURS[naming(estimator).family]
