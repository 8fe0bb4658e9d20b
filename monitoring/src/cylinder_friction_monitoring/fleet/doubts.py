"""Sessions that are kept but not assessed: a clock that cannot be right, a log that is hardly of this cylinder."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime, timedelta
from itertools import pairwise
from statistics import median

from cylinder_friction_monitoring.trends.assessment import Entry
from cylinder_friction_monitoring.trends.moments import moment
from cylinder_friction_monitoring.trends.session_row import SessionRow

FAR_D = 60.0
"""A session that is further in time from both neighbours by name has a clock that is off [days]."""
LONE_D = 180.0
"""A single session that is so much older than all others may be of a clock that is off [days]."""
CHRONOLOGICAL = 0.8
"""Names are in the order of time if this share of neighbours is."""
FEW = 5
"""With fewer sessions before it, nothing is known of what a session should show."""
FRICTIONS, SCATTERS = 5.0, 10.0
"""A half sum this many frictions and this many scatters away from what is usual is hardly of this cylinder."""


def doubts(rows: Sequence[SessionRow], entries: Sequence[Entry], now: datetime) -> dict[str, str]:
    """Return why sessions are not assessed, by session; sessions without doubt are absent.

    Args:
        rows: All sessions of one cylinder.
        entries: Its entries; what is usual begins anew with a reset or reference.
        now: No session begins later.
    """
    found = doubtful_starts({row.session: row.start for row in rows}, now)
    trusted = sorted((row for row in rows if row.session not in found), key=lambda row: (row.start, row.session))
    return found | _foreign(trusted, [each.time for each in entries if each.kind in ("reset", "reference")])


def doubtful_starts(starts: Mapping[str, str], now: datetime) -> dict[str, str]:
    """Return why a session's start cannot be right, by session.

    Names often are in the order of time, by a date or a counter in them: then a session must lie between its neighbours
    by name. If names are in no order, a clock that is off looks like a log that comes late.
    """
    found, times = dict[str, str](), dict[str, datetime]()
    for session, start in starts.items():
        if not start:
            if any(starts.values()):
                found[session] = f"its log states no start, others do; {_correct(session)}"
        elif (time := moment(start)) > now + timedelta(days=1.0):
            found[session] = f"begins in the future, at {start}: its clock is off; {_correct(session)}"
        else:
            times[session] = time
    names = sorted(times)
    pairs = [times[one] <= times[other] for one, other in pairwise(names)]
    if len(names) >= FEW and sum(pairs) >= CHRONOLOGICAL * len(pairs):
        found |= _out_of_order(names, times)
    elif len(names) >= FEW:
        first, second = sorted(names, key=lambda name: times[name])[:2]
        gap_d = (times[second] - times[first]).total_seconds() / 86400.0
        if gap_d > LONE_D:
            found[first] = f"begins {gap_d:.0f} days before all other sessions: its clock may be off; {_correct(first)}"
    return found


def _out_of_order(names: Sequence[str], times: Mapping[str, datetime]) -> dict[str, str]:
    """Return the sessions that are far from the times between which their names put them."""
    found, last = dict[str, str](), len(names) - 1
    for place, name in enumerate(names):
        before = [times[each] for each in names[max(place - 3, 0) : place]]
        after = [times[each] for each in names[place + 1 : place + 4]]
        both = [*before, *after]
        middle = sorted(both)[len(both) // 2]
        away_d = (times[name] - middle).total_seconds() / 86400.0
        nearest_d = min(abs((times[name] - each).total_seconds()) for each in both) / 86400.0
        # The first session may be much older, and the last much later than the others: the machine stood still.
        late = place == last and away_d > 0.0
        early = place == 0 and away_d < 0.0 and -away_d < LONE_D
        if nearest_d > FAR_D and not late and not early:
            found[name] = (
                f"begins at {times[name]:%Y-%m-%d}, {abs(away_d):.0f} days {'after' if away_d > 0 else 'before'} its "
                f"neighbours by name: its clock is off; {_correct(name)}"
            )
    return found


def _correct(session: str) -> str:
    return f"state the right one in fleet.yaml, starts: {{{session}: ...}}"


def _foreign(rows: Sequence[SessionRow], anew: Sequence[str]) -> dict[str, str]:
    """Return the sessions whose forces are not those of a cylinder with these dimensions, or not of this one."""
    found, usual, begun = dict[str, str](), list[SessionRow](), 0
    for row in rows:
        since = sum(moment(time) <= moment(row.start) for time in anew) if row.start else 0
        if since != begun:
            usual, begun = [], since
        reason = _impossible(row) or (_unusual(row, usual) if len(usual) >= FEW else "")
        if reason:
            found[row.session] = reason
        else:
            usual.append(row)
    return found


def _impossible(row: SessionRow) -> str:
    friction = row.indicators["friction_n"]
    if friction.value is None or friction.value > -3.0 * (friction.uncertainty or 0.0) or friction.value >= 0.0:
        return ""
    return (
        f"its friction is {friction.value:.0f} N, less than none: a log of another cylinder, or its pressures are "
        "exchanged or its position reversed; correct the mapping or move the log"
    )


def _unusual(row: SessionRow, usual: Sequence[SessionRow]) -> str:
    value = row.indicators["half_sum_n"].value
    sums = [own for each in usual if (own := each.indicators["half_sum_n"].value) is not None]
    frictions = [own for each in usual if (own := each.indicators["friction_n"].value) is not None]
    if value is None or len(sums) < FEW or not frictions:
        return ""
    middle = median(sums)
    scatter = 1.4826 * median(abs(own - middle) for own in sums)
    if abs(value - middle) <= max(FRICTIONS * median(frictions), SCATTERS * scatter):
        return ""
    return (
        f"half the sum of its strokes is {value:.0f} N, where {len(sums)} sessions before it have {middle:.0f} ± "
        f"{scatter:.0f} N: a log of another cylinder, a dead sensor, or a load that nothing states; move the log, or "
        "begin anew with --entry CYLINDER reset"
    )
