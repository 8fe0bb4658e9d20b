"""Numbers and names as readers see them."""

import math

from cylinder_friction.reporting.estimator_titles import REFERENCES
from cylinder_friction.reporting.page import NONE
from friction_benchmark.results import Interval, TaskResult

NOTHING = NONE.words


def of_size(value: float) -> str:
    """Return a number with about three digits: 0.12, 4.56, 45.6, 456."""
    if not math.isfinite(value):
        return NOTHING
    size = abs(value)
    text = f"{value:.2f}" if size < 9.995 else f"{value:.1f}" if size < 99.95 else f"{value:,.0f}"
    return text.removeprefix("-") if float(text.replace(",", "")) == 0.0 else text.replace("-", "−")


def signed(value: float) -> str:
    """Return a number with its sign, which is a true minus."""
    text = of_size(value)
    return f"+{text}" if value > 0.0 and text.strip("0.") not in ("", NOTHING) else text


def within(interval: Interval) -> str:
    """Return the ends of an interval."""
    return f"{of_size(interval.low)} to {of_size(interval.high)}"


def share(value: float) -> str:
    """Return a share as percent."""
    return f"{100.0 * value:.1f} %"


def counted(value: float) -> str:
    """Return a count with separated thousands."""
    return f"{value:,.0f}"


def seconds(value: float) -> str:
    """Return a time in the unit that suits it."""
    if value < 0.995:
        return f"{1e3 * value:.0f} ms"
    return f"{of_size(value)} s" if value < 120 else f"{value / 60:.1f} min"


def plain(name: str) -> str:
    """Return an identifier as words: ``forecast_100ms`` is forecast 100 ms."""
    words = name.replace("_", " ").split()
    return " ".join(f"{word[:-2]} ms" if word.endswith("ms") and word[:-2].isdigit() else word for word in words)


def split_words(split: str) -> str:
    return plain(split).replace("held out", "held-out")


def capital(words: str) -> str:
    return words[:1].upper() + words[1:]


def denominator(result: TaskResult) -> str:
    """Return the denominator of a result's percentages."""
    return f"mean |{REFERENCES[result.reference]}| = {of_size(result.mean_friction_n)} N"
