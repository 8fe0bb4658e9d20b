"""Find sessions that must not be assessed: their clock is off, or their log is of another cylinder."""

from collections.abc import Mapping, Sequence
from datetime import datetime, timedelta
from itertools import pairwise
from statistics import median

from cylinder_friction_monitoring.trends.assessment import Entry
from cylinder_friction_monitoring.trends.moments import moment
from cylinder_friction_monitoring.trends.session_row import SessionRow

FAR_D = 60.0  # Largest distance of a session from both neighbours by name; beyond it, its clock is off [days]
LONE_D = 180.0  # Largest distance of the oldest session from all others; beyond it, its clock may be off [days]
CHRONOLOGICAL = 0.8
"""Least share of neighbours by name that are in the order of time if names are chronological."""
FEW = 5  # Fewest earlier sessions that a session is compared with
FRICTIONS, SCATTERS = 5.0, 10.0
"""Least distance of a half sum from the usual one that shows another cylinder: in frictions, and in scatters."""


def doubts(rows: Sequence[SessionRow], entries: Sequence[Entry], now: datetime) -> dict[str, str]:
    """State by session why it must not be assessed.

    ``rows`` are all sessions of one cylinder. After a reset or reference among ``entries``, the usual half sum is
    determined again. A session later than ``now`` is doubtful.
    """
    found = doubtful_starts({row.session: row.start for row in rows}, now)
    trusted = sorted((row for row in rows if row.session not in found), key=lambda row: (row.start, row.session))
    return found | _foreign(trusted, [each.time for each in entries if each.kind in ("reset", "reference")])


def doubtful_starts(starts: Mapping[str, str], now: datetime) -> dict[str, str]:
    """State by session why its start cannot be right.

    If names are chronological, by a date or a counter, a session must lie between its neighbours by name. Otherwise a
    wrong clock looks like a late log, and only a session much older than all others is found.
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
    """Find the sessions whose starts are far from those of their neighbours by name."""
    found, last = dict[str, str](), len(names) - 1
    for place, name in enumerate(names):
        before = [times[each] for each in names[max(place - 3, 0) : place]]
        after = [times[each] for each in names[place + 1 : place + 4]]
        both = [*before, *after]
        middle = sorted(both)[len(both) // 2]
        away_d = (times[name] - middle).total_seconds() / 86400.0
        nearest_d = min(abs((times[name] - each).total_seconds()) for each in both) / 86400.0
        # The first session may be much older, and the last much later than the others, if the machine stood still.
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
    """Find the sessions whose forces cannot come from this cylinder."""
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
        f"half the sum of its strokes is {value:.0f} N, while {len(sums)} sessions before it have {middle:.0f} ± "
        f"{scatter:.0f} N: a log of another cylinder, a dead sensor, or a load that nothing states; move the log, or "
        "begin anew with --entry CYLINDER reset"
    )
