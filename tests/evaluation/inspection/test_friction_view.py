"""Friction as the inspection shows it, from strokes whose friction is known."""

from dataclasses import replace

import numpy as np
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.evaluation.inspection.friction_view import friction_view
from cylinder_friction.labelling.label import Labeller
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.signals.smooth_signals import SignalFilter
from inspected_recordings import made_strokes

Filters = dict[str, "SignalFilter"]


def test_the_curve_is_that_of_the_strokes(strokes: Recording, labeller: Labeller, filters: Filters) -> None:
    view = friction_view(strokes, labeller, filters["savitzky_golay"])
    assert view.curve is not None
    speeds = np.array([0.02, 0.05, 0.08])
    np.testing.assert_allclose(view.curve.friction(speeds), 300.0 + 1500.0 * speeds, rtol=0.03)
    assert view.friction_name == "friction"
    assert not view.carries_load


def test_a_load_is_told_from_friction_and_draws_no_curve(
    cylinder: Cylinder, labeller: Labeller, filters: Filters
) -> None:
    view = friction_view(made_strokes(cylinder, load_n=4000.0), labeller, filters["savitzky_golay"])
    assert view.load_n == pytest.approx(4000.0, rel=0.02)
    assert view.half_difference_n == pytest.approx(380.0, rel=0.15)
    assert view.curve is None
    assert "oppose the motion, as friction must" in view.no_curve
    assert view.friction_name == "friction + load"
    less = friction_view(made_strokes(cylinder, load_n=300.0), labeller, filters["savitzky_golay"])
    assert "N of the force do not turn with the direction, as friction would" in less.no_curve


def test_a_known_load_is_taken_off(cylinder: Cylinder, labeller: Labeller, filters: Filters) -> None:
    loaded = made_strokes(cylinder, load_n=4000.0)
    with_cell = loaded.with_columns(load_force_n=np.full(12000, 4000.0))
    for recording, load, words in (
        (with_cell, "measured", "Load: measured."),
        (loaded, "position", "a load; zeros, which are not stated, come on top. A1"),
    ):
        view = friction_view(recording, replace(labeller, load=load), filters["savitzky_golay"])
        assert view.friction_name == "friction"
        assert view.load_n == pytest.approx(0.0, abs=10.0)
        assert words in view.assumed[0]


@pytest.mark.parametrize("method", ["savitzky_golay", "rts"])
def test_a_drive_force_stands_for_pressures(
    cylinder: Cylinder, labeller: Labeller, filters: Filters, method: str
) -> None:
    strokes = made_strokes(cylinder)
    force = (
        strokes.column("pressure_1_pa") * cylinder.piston_area_m2
        - strokes.column("pressure_2_pa") * cylinder.annulus_area_m2
    )
    table = strokes.table.drop(columns=["pressure_1_pa", "pressure_2_pa"]).assign(drive_force_n=force)
    view = friction_view(replace(strokes, columns=table), labeller, filters[method])
    with_pressures = friction_view(strokes, labeller, filters[method])
    assert view.force_name == "drive force"
    np.testing.assert_allclose(view.half_difference_n, with_pressures.half_difference_n, rtol=0.01)


def test_what_counts_as_standstill_follows_from_the_sensor_s_own_noise(
    cylinder: Cylinder, labeller: Labeller, filters: Filters
) -> None:
    """Twice the noise, twice the speed, with a rest to see it at or without."""
    noise = np.random.default_rng(2).normal(0.0, 1e-4, 12000)
    for rest_s in (0.0, 3.0):
        strokes = made_strokes(cylinder, rest_s=rest_s)
        once, twice = (
            friction_view(
                strokes.with_columns(position_m=strokes.column("position_m") + times * noise),
                labeller,
                filters["savitzky_golay"],
            ).slowest_m_s
            for times in (1.0, 2.0)
        )
        assert twice == pytest.approx(2.0 * once, rel=0.06)
