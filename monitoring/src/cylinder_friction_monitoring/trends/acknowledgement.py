"""When an acknowledged alarm returns: its limit may be passed, its change has grown by half, or its time is over."""

from __future__ import annotations

from cylinder_friction_monitoring.trends.assessment import Entry
from cylinder_friction_monitoring.trends.dating import Dated
from cylinder_friction_monitoring.trends.moments import moment
from cylinder_friction_monitoring.trends.plan import MonitorPlan
from cylinder_friction_monitoring.trends.sentences import TITLES, with_unit
from cylinder_friction_monitoring.trends.trend import Tested

BEYOND_LIMIT = 5
"""While the limit may be passed, an acknowledgement holds for fewer than this many sessions."""
GROWN = 1.5
"""An alarm returns if its change is this many times what it was when somebody acknowledged it."""


def why_it_returns(test: Tested, alarm: int, found: Dated, seen: Entry, plan: MonitorPlan) -> str:
    """Return why an acknowledged alarm of an indicator returns; empty if it does not.

    Args:
        test: Of the indicator.
        alarm: Session of the alarm.
        found: Its change by now.
        seen: The acknowledgement, made after the alarm.
        plan: Holds the limit, if the user set one.
    """
    count = sum(bool(row.start) and moment(row.start) <= moment(seen.time) for row in test.rows)
    limit, since = plan.limit_percent.get(test.indicator), len(test.rows) - count
    least, most = test.latest(found)
    if limit is not None and most >= 0.01 * limit * abs(test.reference.level) and since >= BEYOND_LIMIT:
        return f"the limit of {limit:g} % for {TITLES[test.indicator]} may be passed"
    then = test.until(count).dated(alarm).change
    if found.change * then < 0.0 or least >= GROWN * abs(then):
        was, grown = with_unit(abs(then), test.indicator), with_unit(least, test.indicator)
        return f"{TITLES[test.indicator]} had changed by {was} then, and by at least {grown} now"
    return ""
