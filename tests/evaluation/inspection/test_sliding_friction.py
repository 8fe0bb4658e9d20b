"""Mean friction while sliding and its interval, and what is stated in its place where it is not friction alone."""

import math
from collections.abc import Callable
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
from cylinder_friction.recordings.checks.limits import Finding
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


BACKWARDS = "friction would push the piston (-"
FINDINGS: dict[str, tuple[Callable[[Cylinder], Recording], str, str]] = {
    "no accuracy": (made_strokes, "ok", "retracting (no interval: the sensors' accuracy is not stated)"),
    "stated accuracy": (lambda cylinder: stated(made_strokes(cylinder)), "ok", "retracting (95 %)"),
    "a load": (
        lambda cylinder: made_strokes(cylinder, load_n=4000.0),
        "refused",
        " N does not turn with the direction; state the load (--load; ingest.load in a project) or a line",
    ),
    "a load below friction, zeros unknown": (lambda cylinder: made_strokes(cylinder, load_n=170.0), "ok", ""),
    "a load below friction": (
        lambda cylinder: stated(made_strokes(cylinder, load_n=170.0), 1000.0),
        "refused",
        "while the stated zeros and an asymmetry of friction explain",
    ),
    "a sensor the other way round": (lambda cylinder: turned(made_strokes(cylinder, sign=-1.0)), "refused", BACKWARDS),
    "a force the other way round": (
        lambda cylinder: one_way(cylinder, -300.0),
        "refused",
        "other way or is disturbed, the",
    ),
    "one direction": (
        lambda cylinder: one_way(cylinder, 300.0),
        "noted",
        "at most 9.15 mm/s extending and 0 mm/s retracting; position_m goes from",
    ),
    "at rest": (
        lambda cylinder: made_strokes(cylinder, rest_s=20.0, seconds=20.0),
        "refused",
        "nothing slides faster than ",
    ),
}


def turned(recording: Recording) -> Recording:
    return recording.with_columns(position_m=recording.column("position_m") + 0.25)


@pytest.mark.parametrize("what", FINDINGS)
def test_the_finding_states_friction_or_why_it_cannot(
    what: str, cylinder: Cylinder, labeller: Labeller, filters: Filters
) -> None:
    made, outcome, words = FINDINGS[what]
    found = finding(made(cylinder), labeller, filters)
    assert found.outcome == outcome
    assert words in found.text


def test_a_load_that_position_decides_is_taken_off_before(
    cylinder: Cylinder, labeller: Labeller, filters: Filters
) -> None:
    taken_off = replace(labeller, load="position")
    assert finding(made_strokes(cylinder, load_n=4000.0), taken_off, filters).outcome == "ok"
