"""Summarize a cylinder in one line of the page: answer, reason, trend, and how urgently it needs a person."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import timedelta

from cylinder_friction_monitoring.trends.assessment import NE107, Answer, Assessment
from cylinder_friction_monitoring.trends.moments import moment
from cylinder_friction_monitoring.trends.session_row import INDICATORS, SessionRow

POINTS = 90  # Largest number of points of a drawn trend
SILENT_D = 30.0  # Time without a session, while others have sessions, after which a cylinder needs a look [days]
RANKS: Mapping[Answer, int] = {"alarm": 0, "undecided": 1, "watch": 2, "not yet": 5, "fine": 6}
ACKNOWLEDGED, LOOK = 4, 3
"""Rank of an alarm that somebody has acknowledged, and of a cylinder whose logs need a look."""


@dataclass(frozen=True)
class Trend:
    """An indicator over the sessions, and its baseline."""

    indicator: str
    values: tuple[float | None, ...]  # Compensated, in the indicator's unit, evenly thinned
    level: float | None = None  # Level of the baseline; None without one
    scatter: float | None = None  # Scatter of single sessions around the level
    baseline: int = 0  # Number of values in the baseline
    since: int | None = None  # Index of the value at which the change began


@dataclass(frozen=True)
class CylinderLine:
    """One cylinder on the page, in the JSON and in the database."""

    cylinder: str
    answer: Answer
    ne107: str
    headline: str  # What changed, how much, since when; empty without a change
    words: str
    rank: int  # 0 needs a person most
    trend: Trend
    sessions: int  # Number of assessed sessions
    left_out: int  # Number of sessions that are not assessed
    last_session: str
    last_start: str
    acknowledged: str = ""  # By whom and when
    look: str = ""  # What else needs a look, in words
    about: str = ""  # What the fleet file states about it
    alarms: tuple[str, ...] = ()  # Identifiers of alarms, from indicator, direction and baseline
    state: str = ""  # SHA-256 of everything behind the assessment


def line_of(
    assessment: Assessment,
    rows: Sequence[SessionRow],
    left_out: Mapping[str, str],
    state: str,
    about: str = "",
    late: int = 0,
) -> CylinderLine:
    """Summarize a cylinder; ``rows`` are all its sessions in the order of time, of which ``late`` came too late."""
    used = [row for row in rows if row.session not in left_out]
    last = used[-1] if used else None
    starts = {row.session: row.start for row in rows}
    looks = []
    last_out = [row for row in rows[-3:] if row.session in left_out]
    if len(last_out) == min(len(rows), 3) and last_out:
        count = f"last {len(last_out)} sessions are" if last_out[1:] else "session is"
        looks.append(f"its {count} not assessed")
    if late:
        looks.append(f"sessions that came too late to be assessed: {late}")
    if assessment.model and assessment.model.lost:
        looks.append(assessment.model.words.rstrip("."))
    rank = ACKNOWLEDGED if assessment.acknowledged else RANKS[assessment.answer]
    return CylinderLine(
        cylinder=assessment.cylinder,
        answer=assessment.answer,
        ne107=NE107[assessment.answer],
        headline=_headline(assessment, starts),
        words=assessment.words,
        rank=min(rank, LOOK) if looks else rank,
        trend=_trend(assessment),
        sessions=len(used),
        left_out=len(left_out),
        last_session=last.session if last else "",
        last_start=last.start if last else "",
        acknowledged=assessment.acknowledged,
        look="; ".join(looks),
        about=about,
        alarms=_alarms(assessment),
        state=state,
    )


def in_order(lines: Sequence[CylinderLine]) -> tuple[CylinderLine, ...]:
    """Sort lines by how urgently they need a person; a cylinder that is silent while others are not needs a look."""
    newest = max((moment(each.last_start) for each in lines if each.last_start), default=None)
    seen = []
    for each in lines:
        if newest is not None and each.last_start and newest - moment(each.last_start) > timedelta(days=SILENT_D):
            silent = f"no session since {each.last_start[:10]}"
            each = replace(each, look=f"{each.look}; {silent}" if each.look else silent, rank=min(each.rank, LOOK))
        seen.append(each)
    return tuple(sorted(seen, key=lambda each: (each.rank, each.cylinder)))


def _headline(assessment: Assessment, starts: Mapping[str, str]) -> str:
    if not assessment.changes:
        return ""
    change = assessment.changes[0]
    unit, name, _, factor = INDICATORS[change.indicator]
    size = f"{digits(factor * change.change)} {unit}" if change.percent is None else f"{change.percent:+.0f} %"
    return f"{name} {size} since {starts.get(change.since, '')[:10] or change.since}"


def digits(number: float) -> str:
    """Write a signed number with three digits or more, without a power of ten."""
    return f"{number:+.0f}" if 100.0 <= abs(number) < 1e6 else f"{number:+.3g}"


def _alarms(assessment: Assessment) -> tuple[str, ...]:
    if assessment.answer != "alarm":
        return ()
    names = []
    for each in assessment.changes:
        trend = assessment.trends.get(each.indicator)
        first = trend.baseline.first if trend and trend.baseline else ""
        names.append(f"{each.indicator} {'up' if each.change > 0.0 else 'down'} from {first}")
    return tuple(names)


def _trend(assessment: Assessment) -> Trend:
    indicator = assessment.changes[0].indicator if assessment.changes else "friction_n"
    trend = assessment.trends.get(indicator)
    if trend is None:
        return Trend(indicator, ())
    step = -(-len(trend.sessions) // POINTS) or 1
    places = range((len(trend.sessions) - 1) % step, len(trend.sessions), step)  # the last session is among them
    sessions = [trend.sessions[place] for place in places]
    values = tuple(trend.compensated[place] for place in places)
    since = None
    if assessment.changes and assessment.changes[0].since in trend.sessions:
        since = sum(place < trend.sessions.index(assessment.changes[0].since) for place in places)
        since = min(since, len(values) - 1)
    base = trend.baseline
    if base is None:
        return Trend(indicator, values)
    last = trend.sessions.index(base.last) if base.last in trend.sessions else len(sessions) - 1
    count = sum(place <= last for place in places)
    return Trend(indicator, values, base.level, base.scatter, count, since)
