import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from boom import boom_load, boom_points
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.labelling.load import LoadPlan, identify_load
from cylinder_friction.labelling.pooled_load import POOLED_PLACES, pooled_load
from cylinder_friction.labelling.sliding_blocks import OffsetPlan
from cylinder_friction.labelling.strokes import BINS
from cylinder_friction.recordings.columns import COVERAGE_FACTOR, PRESSURES
from cylinder_friction.recordings.recording import Recording, RecordingError, SensorUncertainty


def test_load_and_friction_of_a_boom_are_found() -> None:
    found = identify_load(boom_points(), LoadPlan())
    grid = np.linspace(*found.range_m, 40)
    assert np.abs(found.load_n(grid) - boom_load(grid)).max() < 15.0
    assert found.coulomb_n == pytest.approx(400.0, rel=0.02)
    assert found.coulomb_interval_n[0] < 400.0 < found.coulomb_interval_n[1]
    assert 2 <= found.order <= 6
    assert found.load_range_n[0] == pytest.approx(boom_load(grid).min(), abs=20.0)
    assert min(found.strokes_extend, found.strokes_retract) >= 7


@pytest.mark.extended
def test_scatter_covers_the_error_as_often_as_it_says() -> None:
    """Without asymmetry the error of the load is what strokes scatter: about 95 % within two standard deviations."""
    inside = []
    for seed in range(20):
        found = identify_load(boom_points(seed), LoadPlan(asymmetry=0.0))
        grid = np.linspace(*found.range_m, 30)
        inside.append(np.abs(found.load_n(grid) - boom_load(grid)) < 2.0 * found.uncertainty_n(grid))
    assert 0.80 < np.mean(inside) <= 1.0
    assert np.mean(inside) < 1.0


@pytest.mark.parametrize("asymmetry_n", [-40.0, 60.0])
def test_a_constant_asymmetry_goes_into_the_load_and_is_within_its_uncertainty(asymmetry_n: float) -> None:
    found = identify_load(boom_points(asymmetry_n=asymmetry_n), LoadPlan())
    grid = np.linspace(*found.range_m, 40)
    error = found.load_n(grid) - boom_load(grid)
    assert error.mean() == pytest.approx(-asymmetry_n, abs=5.0)
    assert (np.abs(error) < 2.0 * found.uncertainty_n(grid)).all()
    assert found.asymmetry_n >= 0.15 * found.coulomb_n


def test_friction_that_pressure_makes_asymmetric_is_within_the_uncertainty() -> None:
    """Under a weight pressure is higher extending, here three times; half of friction grows with it."""
    found = identify_load(boom_points(pressed=0.5), LoadPlan(asymmetry=0.0))
    grid = np.linspace(*found.range_m, 40)
    error = found.load_n(grid) - boom_load(grid)
    assert error.mean() == pytest.approx(100.0, abs=5.0)
    assert (np.abs(error) < 2.0 * found.uncertainty_n(grid)).all()
    assert identify_load(boom_points(), LoadPlan(asymmetry=0.0)).asymmetry_n == 0.0


def test_the_load_as_stated_is_uncertain_by_the_zeros_that_it_absorbed(
    cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    zero_n, recording = 50.0, labelled_recordings[0]
    points = boom_points()
    found = identify_load(replace(points, force_n=points.force_n + zero_n), LoadPlan(asymmetry=0.0))
    half_n = []
    for zero_pa in (0.0, zero_n / math.hypot(cylinder.piston_area_m2, cylinder.annulus_area_m2)):
        stated = dict.fromkeys(PRESSURES, SensorUncertainty(zero_pa, 0.0))
        about = replace(recording.metadata, uncertainty=stated)
        words = found.sentence(replace(recording, metadata=about), cylinder)
        half_n.append(float(words.split("± ")[1].split(" N")[0]))
    grid = np.linspace(*found.range_m, 40)
    assert half_n[0] < np.abs(found.load_n(grid) - boom_load(grid)).max() < half_n[1]
    worst_n = COVERAGE_FACTOR * found.uncertainty_n(grid).max()  # where strokes show least of it
    assert half_n[0] == pytest.approx(worst_n, abs=0.6)


def test_the_load_of_several_sessions_is_their_mean_and_as_uncertain_as_one_more() -> None:
    sessions = [identify_load(boom_points(seed), LoadPlan()) for seed in range(2)]
    sessions.append(
        replace(sessions[0], coefficients_n=(sessions[0].coefficients_n[0] + 60.0, *sessions[0].coefficients_n[1:]))
    )
    pooled = pooled_load(sessions)
    positions_m = np.linspace(pooled.first_m, pooled.last_m, 300)
    mean_n = np.mean([each.load_n(positions_m) for each in sessions], axis=0)
    assert np.abs(pooled.at(positions_m) - mean_n).max() < 0.5  # what straight lines between the places leave
    assert pooled.uncertainty_n.min() > max(each.asymmetry_n for each in sessions)
    assert pooled_load(sessions[:1]).uncertainty_n == pytest.approx(
        sessions[0].uncertainty_n(np.linspace(*sessions[0].range_m, POOLED_PLACES))
    )


def test_sessions_that_share_no_position_have_no_common_load() -> None:
    one = identify_load(boom_points(), LoadPlan())
    far = replace(one, range_m=(0.3, 0.4))
    with pytest.raises(RecordingError, match=r"share no position: one is known from 0\.3 m on"):
        pooled_load([one, far])
    with pytest.raises(RecordingError, match="got no session"):
        pooled_load([])


def test_outliers_count_little() -> None:
    points = boom_points()
    force_n = points.force_n.copy()
    force_n[::40] += 5000.0
    found = identify_load(replace(points, force_n=force_n), LoadPlan())
    grid = np.linspace(*found.range_m, 40)
    assert np.abs(found.load_n(grid) - boom_load(grid)).max() < 60.0


def test_only_positions_of_both_directions_are_covered() -> None:
    points = boom_points()
    up_only = (points.velocity_m_s < 0.0) & (points.position_m > 0.16)
    found = identify_load(points.where(~up_only), LoadPlan())
    assert found.coverage.holds(np.array([[0.10], [0.15]])).all()
    assert not found.coverage.holds(np.array([[0.17], [0.19]])).any()
    assert len(found.coverage.known) / BINS * np.ptp(found.coverage.travel_m) == pytest.approx(0.115, abs=0.01)
    # Beyond the coverage the load is that of its end, never an extrapolated polynomial.
    assert found.load_n(np.array([0.24])) == found.load_n(np.array([found.range_m[1]]))


def test_strokes_that_determine_no_load_are_refused() -> None:
    points, few = boom_points(), boom_points(seconds=18.0)
    extends, at_m = points.velocity_m_s > 0.0, points.position_m
    for seen, message in (
        (points.where(extends), "got no stroke that retracts; expected strokes of both directions"),
        (points.where(np.where(extends, at_m > 0.13, at_m < 0.12)), r"strokes that extend cover 0\.12.*, with 0 %"),
        (few.where(np.abs(few.position_m - 0.125) < 0.004), r"got \d+ points of 0\.1 s .* expected at least 12"),
        (boom_points(coulomb_n=-400.0, viscous_n_s_m=0.0), r"Coulomb friction would be -399.* check the sign"),
    ):
        with pytest.raises(RecordingError, match=message):
            identify_load(seen, LoadPlan())


@pytest.mark.parametrize(
    ("plan", "field", "value", "message"),
    [
        (LoadPlan, "slowest_m_s", -1.0, "slowest_m_s must be zero or a positive number, but got -1"),
        (LoadPlan, "asymmetry", float("nan"), "asymmetry must be zero or a positive number, but got nan"),
        (OffsetPlan, "slowest_m_s", 0.0, "OffsetPlan: slowest_m_s must be a positive number, but got 0.0"),
        (OffsetPlan, "asymmetry_sd", -0.1, "OffsetPlan: asymmetry_sd must be zero or a positive number, but got -0.1"),
    ],
)
def test_an_impossible_plan_is_refused(plan: Any, field: str, value: float, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        plan(**{field: value})
