"""Write sentences for a maintenance engineer: what changed, how much, since when, and what to do."""

from collections.abc import Sequence

from cylinder_friction_monitoring.trends.assessment import Baseline, Change
from cylinder_friction_monitoring.trends.session_row import INDICATORS

PERIODS = {"month": 30.4, "week": 7.0, "day": 1.0}  # Periods in which a rate is stated [days]
ACTIONS = {
    "friction_n": "plan an inspection of the seals",
    "breakaway_n": "plan an inspection of the seals",
    "viscous_n_s_m": "check the oil, then the seals",
    "leak_m3_s_pa": "shut the cylinder off from its valve: if the load still sinks, the piston seal leaks",
    "profile_n": "look for a bent rod or a scored bore",
}
OIL = "whether the oil was changed, or a sample of it: friction at speed changes with its viscosity"
STEADY = (
    "why it moved: wear, a new seal that runs in, other oil, another load or duty; once it is steady, enter "
    "`reference` with the time from which it is"
)
VENTED = "a reading of both pressure transmitters with vented chambers"


def size(change: Change) -> str:
    """State the size of a change with its interval."""
    verb = "rose" if change.change > 0.0 else "fell"
    low, high = sorted(map(abs, change.interval)) if change.interval[0] * change.interval[1] > 0.0 else change.interval
    percent = "" if change.percent is None else f", {abs(change.percent):.0f} %"
    interval = f"{_shown(low, change.indicator)} to {with_unit(high, change.indicator)}"
    title, amount = INDICATORS[change.indicator].title, with_unit(abs(change.change), change.indicator)
    return f"{title} {verb} by {amount} ({interval}{percent})"


def _shown(value: float, indicator: str) -> str:
    return f"{INDICATORS[indicator].factor * value:.3g}"


def with_unit(value: float, indicator: str) -> str:
    """Write a value in the unit in which people read the indicator."""
    return f"{_shown(value, indicator)} {INDICATORS[indicator].unit}"


def rate(change: Change) -> tuple[float, str]:
    """Choose the longest period in which a rate adds at most the change so far; return its part of a year and name."""
    parts = [(days / 365.25, name) for name, days in PERIODS.items()]
    return next((each for each in parts if each[0] * abs(change.per_year or 0.0) <= abs(change.change)), parts[-1])


def alarm(changes: Sequence[Change]) -> str:
    """State an alarm; the first change matters most."""
    main, *others = changes
    first, last = main.since_interval
    text = f"{size(main)} since session {main.since} (between {first} and {last})"
    low, high = main.per_year_interval or (0.0, 0.0)
    if main.per_year is not None and low * high > 0.0:
        way = "rising" if main.per_year > 0.0 else "falling"
        part, period = rate(main)
        text += f", now {way} by {with_unit(part * abs(main.per_year), main.indicator)} a {period}"
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


def moving(indicator: str, baseline: Baseline, moved: float) -> str:
    """State a baseline that is not used, because the indicator moved within it."""
    verb = "rose" if moved > 0.0 else "fell"
    percent = "" if indicator == "half_sum_n" else f", {100.0 * abs(moved / baseline.level):.0f} %"
    return _sentence(
        f"{INDICATORS[indicator].title} {verb} by {with_unit(abs(moved), indicator)}{percent} within its baseline, "
        f"sessions {baseline.first} to {baseline.last}, which is therefore not used"
    )


def zero_moved(change: Change) -> str:
    """State a half sum that moved while friction did not."""
    return _sentence(
        f"{size(change)} since session {change.since}, and friction itself did not: a transmitter's zero, the load or "
        f"the asymmetry of friction changed; {VENTED} decides"
    )


def doubtful(change: Change, doubts: Sequence[str]) -> str:
    """State a change that need not be wear."""
    return _sentence(
        f"{size(change)} since session {change.since}, which need not be wear; what would decide it: {doubts[0]}"
    )


def better(change: Change, at: str) -> str:
    """State a change for the better."""
    title = INDICATORS[change.indicator].title
    return _sentence(f"{title} changed for the better at session {at}, as after a new seal, and no service is entered")


def not_yet(there: int, wanted: int, scatter: float, why: str) -> str:
    """State how many sessions a baseline lacks. Until then, ``scatter`` is assumed (a share)."""
    text = (
        f"{there} of {wanted} sessions of the baseline are there; {wanted - there} more are needed before an alarm can "
        f"be believed, and until then friction of a session is taken to be known to ± {200.0 * scatter:.0f} %"
    )
    return _sentence(f"{text}; {why}" if why and there == 0 else text)


def _sentence(text: str) -> str:
    return f"{text[0].upper()}{text[1:]}."
