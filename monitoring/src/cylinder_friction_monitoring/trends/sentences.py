"""What an assessment states in words, as a maintenance engineer needs it: what, how much, since when, what to do."""

from __future__ import annotations

from collections.abc import Sequence

from cylinder_friction_monitoring.trends.assessment import Change
from cylinder_friction_monitoring.trends.session_row import INDICATORS

TITLES = {
    "friction_n": "friction",
    "breakaway_n": "breakaway force",
    "viscous_n_s_m": "viscous slope of friction",
    "half_sum_n": "half sum of the strokes",
    "leak_m3_s_pa": "leak past the piston (or through the valve)",
    "profile_n": "variation of friction along the stroke",
}
SCALES = {"leak_m3_s_pa": (6e11, "l/min at 100 bar")}
"""Indicators that people know in another unit."""
ACTIONS = {
    "friction_n": "plan an inspection of the seals",
    "breakaway_n": "plan an inspection of the seals",
    "viscous_n_s_m": "check the oil, then the seals",
    "leak_m3_s_pa": "shut the cylinder off from its valve: if the load still sinks, the piston seal leaks",
    "profile_n": "look for a bent rod or a scored bore",
}
OIL = "whether the oil was changed, or a sample of it: friction at speed changes with its viscosity"
VENTED = "a reading of both pressure transmitters with vented chambers"


def size(change: Change) -> str:
    """Return how much has changed, with its interval."""
    verb = "rose" if change.change > 0.0 else "fell"
    low, high = sorted(map(abs, change.interval)) if change.interval[0] * change.interval[1] > 0.0 else change.interval
    percent = "" if change.percent is None else f", {abs(change.percent):.0f} %"
    interval = f"{_shown(low, change.indicator)} to {with_unit(high, change.indicator)}"
    return (
        f"{TITLES[change.indicator]} {verb} by {with_unit(abs(change.change), change.indicator)} ({interval}{percent})"
    )


def _shown(value: float, indicator: str) -> str:
    return f"{SCALES.get(indicator, (1.0, ''))[0] * value:.3g}"


def with_unit(value: float, indicator: str) -> str:
    """Return a value in the unit in which people know the indicator."""
    return f"{_shown(value, indicator)} {SCALES[indicator][1] if indicator in SCALES else INDICATORS[indicator][0]}"


def alarm(changes: Sequence[Change]) -> str:
    """Return the sentence of an alarm; the first change is the one that matters."""
    main, *others = changes
    first, last = main.since_interval
    text = f"{size(main)} since session {main.since} (between {first} and {last})"
    if main.per_year is not None and main.per_year_interval is not None:
        way = "rising" if main.per_year > 0.0 else "falling"
        text += f", now {way} by {with_unit(abs(main.per_year) / 12.0, main.indicator)} a month"
    if main.limit_passed:
        text += f", and has passed your limit since about {main.limit_reached}"
    elif main.limit_reached is not None:
        _, latest = main.limit_interval or (None, None)
        text += f", and reaches your limit about {main.limit_reached}" + (
            f" ({latest} at the latest)" if latest else ""
        )
    if others:
        text += "; also " + ", ".join(size(each) for each in others)
    return _sentence(f"{text}; {ACTIONS[main.indicator]}")


def zero_moved(change: Change) -> str:
    """Return the sentence of a half sum that moved while friction did not."""
    return _sentence(
        f"{size(change)} since session {change.since}, and friction itself did not: a transmitter's zero, the load or "
        f"the asymmetry of friction changed; {VENTED} decides"
    )


def doubtful(change: Change, doubts: Sequence[str]) -> str:
    """Return the sentence of a change that need not be wear."""
    return _sentence(
        f"{size(change)} since session {change.since}, which need not be wear; what would decide it: {doubts[0]}"
    )


def better(change: Change, at: str) -> str:
    """Return the sentence of a change for the better."""
    return _sentence(
        f"{TITLES[change.indicator]} changed for the better at session {at}, as after a new seal, and no service is "
        "entered"
    )


def not_yet(there: int, wanted: int, scatter: float, why: str) -> str:
    """Return the sentence of a baseline that is too short; ``scatter`` is what is assumed until then, as a share."""
    text = (
        f"{there} of {wanted} sessions of the baseline are there; {wanted - there} more are needed before an alarm can "
        f"be believed, and until then friction of a session is taken to be known to ± {200.0 * scatter:.0f} %"
    )
    return _sentence(f"{text}; {why}" if why and there == 0 else text)


def _sentence(text: str) -> str:
    return f"{text[0].upper()}{text[1:]}."
