"""Settings that make no sense are refused by name."""

from collections.abc import Callable
from typing import Any

import pytest

from cylinder_friction_monitoring.trends.plan import IndicatorPlan, MonitorPlan


@pytest.mark.parametrize(
    ("plan", "given", "words"),
    [
        (MonitorPlan, {"baseline_sessions": 10}, "baseline_sessions must be at least 30, but got 10"),
        (MonitorPlan, {"false_alarms_per_year": 2.0}, r"at most 1, but got 2.0"),
        (MonitorPlan, {"limit_percent": {"friction": 20.0}}, "got indicator 'friction', but expected one of"),
        (MonitorPlan, {"limit_percent": {"friction_n": -20.0}}, r"limit_percent.friction_n: expected a positive"),
        (IndicatorPlan, {"bulk_modulus_pa": -1.0}, "IndicatorPlan: bulk_modulus_pa must be a positive number"),
        (IndicatorPlan, {"bootstrap": 0}, "IndicatorPlan: bootstrap must be a positive number"),
        (IndicatorPlan, {"match_speed": float("nan")}, "IndicatorPlan: match_speed must be a positive number"),
    ],
)
def test_a_senseless_setting_is_refused(plan: Callable[..., object], given: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        plan(**given)
