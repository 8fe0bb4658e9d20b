"""A load that position decides: looked up as NumPy interpolates, refused where it is none, the same after saving."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylinder_friction.realtime.position_load import PositionLoad, load_at

LOADS = np.array([-300.0, 500.0, 450.0, 2000.0, 2000.0])


def made(**changed: object) -> PositionLoad:
    fields = {"first_m": 0.02, "last_m": 0.22, "load_n": LOADS, "uncertainty_n": np.full(len(LOADS), 4.0)}
    return PositionLoad(**fields | changed)  # type: ignore[arg-type]


@settings(deadline=None)  # the first call compiles
@given(st.floats(-1.0, 1.0))
def test_it_is_linear_between_its_places_and_held_beyond_them(position_m: float) -> None:
    load = made()
    expected = np.interp(position_m, np.linspace(0.02, 0.22, len(LOADS)), LOADS)
    assert load_at(load.packed(), position_m) == pytest.approx(expected, abs=1e-9)
    assert load.at(np.array([position_m]))[0] == load_at(load.packed(), position_m)


def test_it_is_the_same_after_saving() -> None:
    load = made(load_n=LOADS / 3.0)
    again = PositionLoad.from_dict(load.to_dict())
    np.testing.assert_array_equal(again.packed(), load.packed())
    np.testing.assert_array_equal(again.uncertainty_n, load.uncertainty_n)


def test_its_words_name_range_and_uncertainty() -> None:
    assert made().in_words() == (
        "a load of -300 to 2000 N, which position decides between 0.02 and 0.22 m, known to 4 N (standard "
        "uncertainty), is taken off"
    )


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"last_m": 0.02}, "expected positions in order, but got 0.02 and 0.02 m"),
        ({"load_n": np.zeros(4)}, r"as many uncertainties, but got shapes \(4,\) and \(5,\)"),
        ({"load_n": np.full(5, np.nan)}, "expected finite loads and uncertainties"),
    ],
)
def test_what_is_no_load_is_refused(changed: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        made(**changed)
