"""Select the entries in force, and decide whether an acknowledged alarm returns."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

from cylinder_friction_monitoring.trends.assessment import Entry
from cylinder_friction_monitoring.trends.dating import Dated
from cylinder_friction_monitoring.trends.moments import moment, utc_time
from cylinder_friction_monitoring.trends.plan import MonitorPlan
from cylinder_friction_monitoring.trends.sentences import with_unit
from cylinder_friction_monitoring.trends.session_row import INDICATORS
from cylinder_friction_monitoring.trends.trend import Tested

NEW_BASELINE = ("service", "reset", "reference")
NEAR_D = 60.0  # Largest distance of an entry from the nearest session of its cylinder [days]
BEYOND_LIMIT = 5  # Number of sessions after which an acknowledgement ends while the limit may be passed
GROWN = 1.5  # Growth of a change since its acknowledgement, as a factor, at which the alarm returns


@dataclass(frozen=True)
class InForce:
    """The entries in force of a cylinder."""

    begins: str = ""  # Time at which the baseline begins; empty: at the first session
    acknowledged: Entry | None = None  # The newest acknowledgement
    over: str = ""  # Time at which this acknowledgement ended; empty if it has not
    waiting: tuple[str, ...] = ()  # Questions about entries whose baseline does not begin yet


def in_force(entries: Sequence[Entry], starts: Sequence[str], now: datetime | None, days: float) -> InForce:
    """Select the entries of one cylinder that are in force at ``now``; with None, all dates are in the past.

    A new baseline begins at its date. If the date is far after the newest of ``starts``, the baseline waits for a later
    session, so that a mistyped year hides no alarm. An acknowledgement ends after ``days``, unless it states its own
    end.
    """
    own = sorted((each for each in entries if not each.withdrawn), key=lambda each: moment(each.time))
    newest = max((moment(start) for start in starts if start), default=None)
    begins, waiting = "", list[str]()
    for entry in (each for each in own if each.kind in NEW_BASELINE):
        why = _waits(entry, newest, now)
        if why:
            waiting.append(why)
        else:
            begins = entry.time
    made = [each for each in own if each.kind == "acknowledge" and (now is None or moment(each.time) <= now)]
    if not made:
        return InForce(begins, waiting=tuple(waiting))
    ends = moment(made[-1].until) if made[-1].until else moment(made[-1].time) + timedelta(days=days)
    over = utc_time(ends.isoformat(), "until") if now is not None and ends <= now else ""
    return InForce(begins, made[-1], over, tuple(waiting))


def _waits(entry: Entry, newest: datetime | None, now: datetime | None) -> str:
    """Ask about an entry whose baseline does not begin yet; empty if it begins."""
    time, named = moment(entry.time), f"the {entry.kind} of {entry.time[:10]} (entered by {entry.name})"
    if now is not None and time > now:
        return f"is the date right? {named} has not come, and counts from then on; if it is mistyped, withdraw it"
    if newest is not None and time - newest > timedelta(days=NEAR_D):
        return (
            f"is the date right? {named} is {(time - newest).days} days after the newest session, and counts from the "
            "next session on; if it is mistyped, withdraw it"
        )
    return ""


def why_it_returns(test: Tested, alarm: int, found: Dated, seen: Entry, plan: MonitorPlan) -> str:
    """State why the acknowledged alarm of an indicator at session ``alarm`` returns; empty if it does not.

    ``found`` is the present change, and ``seen`` is the acknowledgement, made after the alarm.
    """
    count = sum(bool(row.start) and moment(row.start) <= moment(seen.time) for row in test.rows)
    limit, since = plan.limit_percent.get(test.indicator), len(test.rows) - count
    least, most, title = abs(found.change), max(map(abs, found.change_interval)), INDICATORS[test.indicator].title
    if limit is not None and most >= 0.01 * limit * abs(test.reference.level) and since >= BEYOND_LIMIT:
        return f"the limit of {limit:g} % for {title} may be passed"
    then = test.until(count).dated(alarm).change
    if found.change * then < 0.0 or least >= GROWN * abs(then):
        was, grown = with_unit(abs(then), test.indicator), with_unit(least, test.indicator)
        return f"{title} had changed by {was} then, and by at least {grown} now"
    return ""
