"""Mean friction while sliding and its interval, and what is stated in its place where it is not friction alone."""

import math
from dataclasses import replace

import numpy as np
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.evaluation.inspection.friction_view import friction_view
from cylinder_friction.evaluation.inspection.sliding_friction import (
    friction_finding,
    sliding_friction,
    stroke_half_width,
)
from cylinder_friction.labelling.label import Labeller
from cylinder_friction.labelling.sliding_blocks import OffsetPlan, zero_uncertainty_n
from cylinder_friction.recordings.checks.finding import Finding
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.signals.smooth_signals import SignalFilter
from inspected_recordings import made_strokes, stated

Filters = dict[str, "SignalFilter"]


def finding(recording: Recording, labeller: Labeller, filters: Filters) -> Finding:
    """Return what the inspection states of a recording's friction."""
    view = friction_view(recording, labeller, filters["savitzky_golay"])
    zero_n = zero_uncertainty_n(view.labelled, labeller.cylinder)
    return friction_finding(view, sliding_friction(view), zero_n, OffsetPlan())


def one_way(cylinder: Cylinder, force_n: float) -> Recording:
    """Return a recording that only extends, under a constant force."""
    strokes = made_strokes(cylinder)
    path_m = np.cumsum(np.abs(np.gradient(strokes.column("position_m"))))
    pressure_1_pa = (force_n + strokes.column("pressure_2_pa") * cylinder.annulus_area_m2) / cylinder.piston_area_m2
    return strokes.with_columns(position_m=0.02 + 0.2 * path_m / path_m[-1], pressure_1_pa=pressure_1_pa)


def test_mean_friction_is_that_of_the_strokes_in_both_directions(
    cylinder: Cylinder, labeller: Labeller, filters: Filters
) -> None:
    friction = sliding_friction(friction_view(stated(made_strokes(cylinder)), labeller, filters["savitzky_golay"]))
    assert list(friction) == ["extending", "retracting"]
    for mean in friction.values():  # 300 N + 1500 N s/m at 10, 20, 40 and 80 mm/s, for equal times
        assert mean.mean_n == pytest.approx(300.0 + 1500.0 * 0.0375, rel=0.05)
        zeros_n = 2.0 * 5000.0 * math.hypot(cylinder.piston_area_m2, cylinder.annulus_area_m2)
        assert zeros_n < mean.half_width_n < zeros_n + 60.0


def test_without_stated_sensors_there_is_no_interval(cylinder: Cylinder, labeller: Labeller, filters: Filters) -> None:
    found = finding(made_strokes(cylinder), labeller, filters)
    assert found.outcome == "ok"
    assert found.text.endswith(" N retracting (mean while sliding, no interval: the sensors' accuracy is not stated)")
    assert "±" not in found.text
    assert finding(stated(made_strokes(cylinder)), labeller, filters).text.endswith("(mean while sliding, 95 %)")


def test_rows_of_one_stroke_do_not_count_as_independent() -> None:
    generator = np.random.default_rng(3)
    held = 0
    for _ in range(400):
        rows = generator.integers(20, 200, 12)
        means = generator.normal(300.0, 20.0, 12)
        values = np.repeat(means, rows) + generator.normal(0.0, 5.0, rows.sum())
        half_n = stroke_half_width(values, np.repeat(np.arange(12), rows))
        held += abs(values.mean() - 300.0) < half_n
    assert 0.90 < held / 400 < 0.98
    assert stroke_half_width(np.arange(50.0), np.zeros(50, dtype=np.int64)) == 0.0


def test_where_a_load_is_left_no_friction_is_stated(cylinder: Cylinder, labeller: Labeller, filters: Filters) -> None:
    found = finding(made_strokes(cylinder, load_n=4000.0), labeller, filters)
    assert found.outcome == "refused"
    assert found.text.startswith("the force still holds a load, or a sensor's zero: 4")
    remedy = "state the load (ingest.load), map a load cell, or zero the pressure sensors"
    assert found.text.endswith(f" N does not turn with the direction; {remedy}")
    taken_off = replace(labeller, load="position")
    assert finding(made_strokes(cylinder, load_n=4000.0), taken_off, filters).outcome == "ok"


def test_a_load_smaller_than_friction_shows_where_the_zeros_are_stated(
    cylinder: Cylinder, labeller: Labeller, filters: Filters
) -> None:
    loaded = made_strokes(cylinder, load_n=170.0)
    assert finding(loaded, labeller, filters).outcome == "ok"
    found = finding(stated(loaded, 1000.0), labeller, filters)
    assert found.outcome == "refused"
    assert "where the stated zeros and an asymmetry of friction explain" in found.text


def test_friction_that_would_push_the_piston_is_refused(
    cylinder: Cylinder, labeller: Labeller, filters: Filters
) -> None:
    backwards = made_strokes(cylinder, sign=-1.0)
    backwards = backwards.with_columns(position_m=backwards.column("position_m") + 0.25)
    for recording in (backwards, one_way(cylinder, -300.0)):
        found = finding(recording, labeller, filters)
        assert found.outcome == "refused"
        assert found.text.startswith("friction would push the piston (-")


def test_strokes_in_one_direction_cannot_show_a_load(cylinder: Cylinder, labeller: Labeller, filters: Filters) -> None:
    found = finding(one_way(cylinder, 300.0), labeller, filters)
    assert found.outcome == "noted"
    assert found.text.endswith("the piston slides one way alone, so that a load or a sensor's zero would not show")
    assert "retracting" not in found.text


def test_without_sliding_there_is_no_friction(cylinder: Cylinder, labeller: Labeller, filters: Filters) -> None:
    still = made_strokes(cylinder, rest_s=20.0, seconds=20.0)
    found = finding(still, labeller, filters)
    assert found.outcome == "refused"
    assert found.text.startswith("nothing slides faster than ")
