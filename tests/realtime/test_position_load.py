"""A load that position decides: looked up as NumPy interpolates, refused where it is none, the same after saving."""

from __future__ import annotations

import json

import numpy as np
import pytest
import scipy.interpolate
from hypothesis import given, settings
from hypothesis import strategies as st

from cylinder_friction.realtime.load_table import load_at, load_unknown
from cylinder_friction.realtime.position_load import LoadAxis, PositionLoad
from cylinder_friction.recordings.columns import OTHER_POSITIONS

LOADS = np.array([-300.0, 500.0, 450.0, 2000.0, 2000.0])


def made(**changed: object) -> PositionLoad:
    fields = {"first_m": 0.02, "last_m": 0.22, "load_n": LOADS, "uncertainty_n": np.full(len(LOADS), 4.0)}
    return PositionLoad(**fields | changed)  # type: ignore[arg-type]


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


@settings(deadline=None)
@given(st.integers(1, 3), st.lists(st.floats(-0.5, 1.5), min_size=3, max_size=3), st.integers(0, 2**32 - 1))
def test_of_several_positions_it_is_linear_along_each(count: int, positions_m: list[float], seed: int) -> None:
    generator = np.random.default_rng(seed)
    shape = (4, 3, 5)[:count]
    axes = [np.linspace(0.1 * k, 1.0, places) for k, places in enumerate(shape)]
    others = tuple(LoadAxis(name, a[0], a[-1]) for name, a in zip(OTHER_POSITIONS, axes[1:], strict=False))
    load_n, known = generator.normal(size=shape), generator.random(shape) < 0.7
    load = PositionLoad(axes[0][0], axes[0][-1], load_n, np.abs(load_n), others, known)
    at_m = np.array(positions_m[:count])
    held_m = [np.clip(x, a[0], a[-1]) for x, a in zip(at_m, axes, strict=True)]
    expected = [scipy.interpolate.interpn(axes, table, held_m)[0] for table in (load_n, ~known * 1.0)]
    sample = np.append(np.pi, at_m)  # beside another input
    packed = load.packed(("pressure_1_pa", *load.columns))
    assert load_at(packed, sample) == pytest.approx(expected[0], abs=1e-9)
    assert load.at(at_m[None])[0] == load_at(packed, sample)
    if abs(expected[1] - 0.5) > 1e-9:
        assert load_unknown(packed, sample) == (expected[1] > 0.5)
    again = PositionLoad.from_dict(json.loads(json.dumps(load.to_dict())))
    np.testing.assert_array_equal(again.packed(), load.packed())
