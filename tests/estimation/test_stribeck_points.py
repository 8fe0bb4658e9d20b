"""Points of steady sliding with confidence intervals: strokes count, rows do not."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimation.identification import ModelSearch
from cylinder_friction.estimation.identified_model import IdentifiedCurve, Zeros, stribeck_points
from cylinder_friction.friction_models.stribeck import StribeckCurve
from cylinder_friction.labelling.known_offset import KnownOffset
from cylinder_friction.recordings.recording import Recording, RecordingMetadata

STROKE_ROWS, FRICTION_N = 200, 300.0
CYLINDER = Cylinder(bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0)


def strokes(speeds_m_s: list[float], offsets_n: np.ndarray, curve: StribeckCurve | None = None) -> Recording:
    """Return a second at each speed, extending and retracting, with an offset in each stroke's friction."""
    velocity = np.concatenate([np.full(STROKE_ROWS, way * speed) for speed in speeds_m_s for way in (1.0, -1.0)])
    friction = FRICTION_N * np.sign(velocity) if curve is None else curve.friction(velocity)
    time_s = 0.005 * np.arange(len(velocity))
    friction = friction + np.repeat(offsets_n, STROKE_ROWS)
    raw = {"time_s": time_s, "position_m": np.cumsum(velocity) * 0.005, "drive_force_n": friction}
    table = pd.DataFrame({**raw, "velocity_m_s": velocity, "friction_n": friction})
    return Recording(RecordingMetadata("r", "1", "s", 0.005), table)


@pytest.mark.extended
def test_intervals_hold_the_truth_as_often_as_they_say() -> None:
    generator, held, repeats = np.random.default_rng(0), 0, 200
    for _ in range(repeats):
        *_, point = stribeck_points([strokes([0.05] * 5, generator.normal(0.0, 20.0, 10))], 1e-3, 0.95)
        assert point.strokes == 5
        held += abs(point.friction_n - FRICTION_N) <= point.half_width_n
    assert 0.9 < held / repeats <= 0.99


def test_a_curve_without_slow_or_fast_sliding_has_no_numbers_for_it() -> None:
    curve, crept = StribeckCurve(240.0, 360.0, 2e-3, 1.5, 1500.0, 1.2), np.geomspace(2e-3, 12e-3, 8).tolist()
    speeds = np.geomspace(1e-3, 0.2, 12).tolist()
    cases = ((speeds, 0.0, True, True), (speeds[5:], 0.0, False, True), (crept, 5.0, True, False))
    for chosen, off_n, known, viscous in cases:
        recording = strokes(chosen, np.random.default_rng(0).normal(0.0, off_n, 2 * len(chosen)), curve)
        points = stribeck_points([recording], 5e-4, 0.95)
        found = IdentifiedCurve.through([recording], points, Zeros(0.0), None, CYLINDER).to_dict()
        assert found["curve"]["coulomb_n"] == pytest.approx(240.0, rel=0.1)
        assert [found["curve"][name] is not None for name in ("static_n", "viscous_n_s_m")] == [known, viscous]
        assert bool(found["why_not"]) != (known and viscous)


@pytest.mark.parametrize(
    ("scatter_n", "zeros_n", "advice"),
    [(400.0, 0.0, "record more strokes of each speed"), (1.0, 200.0, "state how exact the sensors are")],
)
def test_points_that_are_too_wide_to_use_are_counted(scatter_n: float, zeros_n: float, advice: str) -> None:
    speeds = np.repeat(np.geomspace(5e-3, 0.1, 6), 3).tolist()
    curve = StribeckCurve(240.0, 360.0, 2e-3, 1.5, 1500.0, 1.2)
    recording = strokes(speeds, np.random.default_rng(0).normal(0.0, scatter_n, 2 * len(speeds)), curve)
    points = stribeck_points([recording], 5e-4, 0.95)
    found = IdentifiedCurve.through([recording], points, Zeros(zeros_n), None, CYLINDER)
    percents = [each["half_width_percent"] for each in found.to_dict()["points"]]
    wide = sum(each > 50.0 for each in percents)
    assert wide > 0
    start = f"± more than 50 % in {wide} of {len(percents)} points, too wide to use: "
    assert found.too_wide.startswith(start)
    assert advice in found.too_wide
    sure = IdentifiedCurve.through(
        [recording], [replace(each, half_width_n=0.0) for each in points], Zeros(0.0), None, CYLINDER
    )
    assert sure.too_wide == ""


def test_a_curve_has_no_number_with_unknown_zeros_however_alike_its_sessions_are() -> None:
    speeds, curve = np.geomspace(7e-3, 0.1, 9).tolist(), StribeckCurve(240.0, 360.0, 2e-3, 1.5, 1500.0, 1.2)
    sessions = []
    for name, zero_n in (("a", -12.0), ("b", 0.0), ("c", 12.0)):
        own = strokes(speeds, np.full(18, zero_n), curve)
        noisy_m = own.column("position_m") + np.random.default_rng(0).normal(0.0, 3e-5, len(own))
        sessions.append(replace(own.with_columns(position_m=noisy_m), metadata=replace(own.metadata, session=name)))
    points, zeros = stribeck_points(sessions[:1], 5e-4, 0.95), Zeros(np.inf, "zeros are not stated")
    one = IdentifiedCurve.through(sessions[:1], points, zeros, None, CYLINDER)
    assert one.to_dict()["why_not"].startswith("zeros are not stated; at the slowest steady sliding")
    assert (one.curve, {each.known_half_width_n for each in one.points}) == (None, {None})
    for load, zeros_n, load_n, advice in (
        ("none", np.nan, 0.0, "state how exact the sensors are"),
        ("none", 300.0, 0.0, "vent the chambers and state what each sensor reads then"),
        ("position", np.nan, 200.0, "map the load (a load cell, or computed from geometry)"),
    ):
        run: Any = SimpleNamespace(cylinder=CYLINDER, loss=None, load_uncertainty_n=load_n)
        run.offsets = {name: KnownOffset(name, "stated uncertainty", "", zeros_n, zeros_n, kept=True) for name in "abc"}
        run.logs = SimpleNamespace(recipe=SimpleNamespace(names=SimpleNamespace(pattern="(?P<session>.*)")))
        run.friction = SimpleNamespace(labeller=SimpleNamespace(load=load))
        found = ModelSearch(sessions, run, generations=1, seed=0).zeros
        assert found.startswith(advice)
