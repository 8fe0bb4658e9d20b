from __future__ import annotations

import numpy as np
import pytest

from cylinder_friction.recordings import RecordingError
from cylinder_friction.recordings.units import QUANTITIES, UNITS, check_unit, to_si


@pytest.mark.parametrize(
    ("value", "unit", "expected"),
    [
        (1.0, "Pa", 1.0),
        (1.0, "kPa", 1e3),
        (2.5, "MPa", 2.5e6),
        (3.0, "bar", 3e5),
        (14.503773773, "psi", 1e5),
        (1.0, "m", 1.0),
        (250.0, "mm", 0.25),
        (10.0, "in", 0.254),
        (5.0, "ms", 0.005),
        (2.0, "s", 2.0),
        (1.5, "kN", 1500.0),
        (7.0, "N", 7.0),
        (40.0, "°C", 40.0),
    ],
)
def test_conversion(value: float, unit: str, expected: float) -> None:
    assert to_si(np.array([value]), unit)[0] == pytest.approx(expected, rel=1e-9)


def test_every_quantity_has_a_unit() -> None:
    assert {unit.quantity for unit in UNITS.values()} == set(QUANTITIES.values())


def test_unknown_unit_lists_the_known_ones() -> None:
    with pytest.raises(RecordingError, match=r"'pressure_1_pa': unit 'atm' is not known; expected one of Pa, kPa, MPa"):
        check_unit("pressure_1_pa", "atm")


def test_unit_of_another_quantity_is_refused() -> None:
    with pytest.raises(RecordingError, match=r"'position_m': unit 'bar' measures pressure, .* one of m, mm, in"):
        check_unit("position_m", "bar")
