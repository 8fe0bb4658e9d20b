"""Find sessions that must not be assessed: dated wrongly, too late, or of another cylinder."""

from collections.abc import Mapping, Sequence
from datetime import datetime, timedelta
from statistics import median

from cylinder_friction_monitoring.fleet.plan import Late
from cylinder_friction_monitoring.trends.assessment import Entry
from cylinder_friction_monitoring.trends.moments import moment
from cylinder_friction_monitoring.trends.session_row import SessionRow

FEW = 5  # Fewest earlier sessions that a session is compared with
FRICTIONS, SCATTERS = 5.0, 10.0
"""Least distance of a half sum from the usual one that shows another cylinder: in frictions, and in scatters."""


def doubts(rows: Sequence[SessionRow], entries: Sequence[Entry], now: datetime) -> dict[str, str]:
    """State by session why it must not be assessed.

    ``rows`` are all sessions of one cylinder. After a reset or reference among ``entries``, the usual half sum is
    determined again. A session later than ``now`` is doubtful.
    """
    found = _doubtful_starts(rows, now)
    trusted = sorted((row for row in rows if row.session not in found), key=lambda row: (row.start, row.session))
    return found | _foreign(trusted, [each.time for each in entries if each.kind in ("reset", "reference")])


def too_late(rows: Sequence[SessionRow], before: Mapping[str, str], newest: str, late: Late) -> dict[str, str]:
    """State by session why it came too late to be assessed.

    What a night has assessed stays where it is: a new session must not begin more than ``late`` days
    before ``newest``, the start of the newest session that an earlier night assessed. ``before``
    holds by session the start at which an earlier night placed it. Such a session is compared with
    its own place instead. With ``accept``, no session is too late.
    """
    found = dict[str, str]()
    for row in rows:
        if late == "accept" or not (row.start and newest):
            continue
        place = min(moment(before.get(row.session) or newest), moment(newest))
        if (place - moment(row.start)) / timedelta(days=1.0) > late:
            found[row.session] = (
                f"begins at {row.start[:10]}, more than {late:g} days before a session that an earlier "
                "night assessed: its clock was set back, or the log came late; "
                f"{_correct(row.session)}, or take late logs as they are dated, late: accept"
            )
    return found


def _doubtful_starts(rows: Sequence[SessionRow], now: datetime) -> dict[str, str]:
    """State by session why its start cannot be right: it is in the future, or missing."""
    found = dict[str, str]()
    for row in rows:
        if row.start and moment(row.start) > now + timedelta(days=1.0):
            why = f"begins in the future, at {row.start}: its clock is off"
        elif not row.start and any(each.start for each in rows):
            why = "its log states no start, others do"
        else:
            continue
        found[row.session] = f"{why}; {_correct(row.session)}"
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
