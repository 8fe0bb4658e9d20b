"""Which entries count by now: nobody withdrew them, their date has come, and their time is not over."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

from cylinder_friction_monitoring.trends.assessment import Entry
from cylinder_friction_monitoring.trends.moments import moment, utc_time

NEW_BASELINE = ("service", "reset", "reference")
NEAR_D = 60.0
"""An entry is far from a cylinder's sessions if none is nearer than this [days]."""


@dataclass(frozen=True)
class InForce:
    """What a cylinder's entries state by now."""

    begins: str = ""  # Time at which the baseline begins; empty: with the first session
    acknowledged: Entry | None = None  # The newest acknowledgement
    over: str = ""  # Time at which this acknowledgement ended; empty if it has not
    waiting: tuple[str, ...] = ()  # Entries whose baseline does not begin yet, in words


def in_force(entries: Sequence[Entry], starts: Sequence[str], now: datetime | None, days: float) -> InForce:
    """Return what entries state by now.

    A new baseline counts once its date has come. If its date is far after the newest session, it counts once a session
    follows it: a mistyped year hides no alarm.

    Args:
        entries: Of one cylinder.
        starts: When its sessions began; empty if a log states no start.
        now: Entries with a later time do not count; None: all dates have come.
        days: Time after which an acknowledgement ends, unless it states another [days].
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
    """Return why the baseline of an entry does not begin yet; empty if it does."""
    time, named = moment(entry.time), f"the {entry.kind} of {entry.time[:10]} (entered by {entry.name})"
    if now is not None and time > now:
        return f"is the date right? {named} has not come, and counts from then on; if it is mistyped, withdraw it"
    if newest is not None and time - newest > timedelta(days=NEAR_D):
        return (
            f"is the date right? {named} is {(time - newest).days} days after the newest session, and counts from the "
            "next session on; if it is mistyped, withdraw it"
        )
    return ""
