"""Settings that make no sense are refused by name."""

import pytest

from cylinder_friction.monitoring.plan import MonitorPlan


def test_too_short_a_baseline() -> None:
    with pytest.raises(ValueError, match="baseline_sessions must be at least 30, but got 10"):
        MonitorPlan(baseline_sessions=10)


def test_too_many_false_alarms() -> None:
    with pytest.raises(ValueError, match=r"at most 1, but got 2.0; more alarms than that are not believed"):
        MonitorPlan(false_alarms_per_year=2.0)


def test_limits() -> None:
    with pytest.raises(ValueError, match="got indicator 'friction', but expected one of friction_n, breakaway_n"):
        MonitorPlan(limit_percent={"friction": 20.0})
    with pytest.raises(ValueError, match=r"limit_percent.friction_n: expected a positive number of percent"):
        MonitorPlan(limit_percent={"friction_n": -20.0})
