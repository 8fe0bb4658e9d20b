"""What a configuration may not state: each rule is refused by its name, with what was expected and what it got."""

import math
import re
from collections.abc import Callable
from functools import partial
from typing import Any

import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.recordings.checks.limits import CheckLimits, StatedLoad
from cylinder_friction.recordings.formats.format import CsvOptions
from cylinder_friction.recordings.line_loss import LineLoss
from cylinder_friction.recordings.logs import NameRules, StartRules
from cylinder_friction.recordings.mapping.channel_mapping import SensorScale
from cylinder_friction.recordings.timeline.timestamps import TimeRules

CYLINDER = Cylinder(bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0)
limits = partial(CheckLimits, CYLINDER)


def sensor(**values: Any) -> SensorScale:
    return SensorScale.from_dict({"range": [0.0, 250.0], "unit": "bar", **values})


@pytest.mark.parametrize(
    ("rules", "values", "message"),
    [
        (TimeRules, {"rate_hz": 0.0}, "rate_hz: expected a positive number or None, but got 0.0"),
        (TimeRules, {"longest_bridge_samples": -1}, "longest_bridge_samples: expected 0 or more, but got -1"),
        (limits, {"highest_pressure_pa": math.inf}, "highest_pressure_pa: expected a positive number, but got inf"),
        (limits, {"load": "gravity"}, "load: expected none, measured or position, but got 'gravity'"),
        *(
            (StatedLoad.parsed, {"text": text}, "expected none, measured, position, or a constant load in newtons")
            for text in ("heavy", "nan", "10+-x", "10+--3", "")
        ),
        (sensor, {"range": (5.0, 5.0)}, "range: expected two different finite numbers, but got (5.0, 5.0)"),
        (sensor, {"bits": 0}, "bits: expected 1 to 32, but got 0"),
        (sensor, {"accuracy_percent": -0.5}, "accuracy_percent: expected 0 to 100 (of full scale), but got -0.5"),
        (sensor, {"accuracy_percent": 0.5, "zero_uncertainty": -1.0}, "zero_uncertainty: expected zero or a"),
        (sensor, {"zero_uncertainty": 0.1}, "zero_uncertainty needs accuracy_percent"),
        (LineLoss, {}, "expected positive bar and speed_m_s, or bar 0, or positive length_m, bore_mm and oil_mm2_s"),
        (LineLoss, {"bar": 3.0, "speed_m_s": 0.1, "length_m": 2.0}, "or positive length_m"),
        (LineLoss, {"bar": 3.0, "speed_m_s": 0.1, "uncertainty_percent": 120.0}, "uncertainty_percent: expected 0 to"),
        (NameRules, {"pattern": "(?P<condition>a)("}, "is not a regular expression"),
        (StartRules, {"pattern": "(?P<year>2)"}, "got groups year, expected year, month, day and, if the name has"),
        (StartRules, {"zone": "Europe/Oslow"}, "zone: got 'Europe/Oslow', expected a name of the time zone database"),
        (CsvOptions, {"encoding": "klingon"}, "encoding: expected one that Python knows"),
    ],
)
def test_an_impossible_rule_is_refused(rules: Callable[..., object], values: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=re.escape(message)):
        rules(**values)
