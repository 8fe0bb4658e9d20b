"""Points of steady sliding with confidence intervals: strokes count, rows do not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimation.identified_model import IdentifiedCurve, StribeckPoint, Zeros, stribeck_points
from cylinder_friction.estimation.steady_intervals import scatter_of_sessions
from cylinder_friction.friction_models.stribeck import StribeckCurve
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


def extending(points: tuple[StribeckPoint, ...]) -> StribeckPoint:
    return next(point for point in points if point.velocity_m_s > 0.0)


@pytest.mark.extended
def test_intervals_hold_the_truth_as_often_as_they_say() -> None:
    generator, held, repeats = np.random.default_rng(0), 0, 200
    for _ in range(repeats):
        point = extending(stribeck_points([strokes([0.05] * 5, generator.normal(0.0, 20.0, 10))], 1e-3, 0.95))
        assert point.strokes == 5
        held += abs(point.friction_n - FRICTION_N) <= point.half_width_n
    assert 0.9 < held / repeats <= 0.99


def test_an_interval_is_no_narrower_for_more_rows_of_the_same_strokes() -> None:
    offsets_n = np.array([-15.0, 0.0, 5.0, 0.0, 25.0, 0.0, 10.0, 0.0])
    recording = strokes([0.05] * 4, offsets_n)
    twice = Recording(
        recording.metadata, recording.table.loc[np.repeat(recording.table.index, 2)].reset_index(drop=True)
    )
    one, other = (extending(stribeck_points([each], 1e-3, 0.95)) for each in (recording, twice))
    assert other.rows > 1.8 * one.rows
    assert other.half_width_n == pytest.approx(one.half_width_n, rel=0.05)


def test_a_curve_without_slow_sliding_has_no_numbers_for_it() -> None:
    curve = StribeckCurve(240.0, 360.0, 2e-3, 1.5, 1500.0, 1.2)
    speeds = np.geomspace(1e-3, 0.2, 12).tolist()
    for chosen, known in ((speeds, True), (speeds[5:], False)):
        recording = strokes(chosen, np.zeros(2 * len(chosen)), curve)
        points = stribeck_points([recording], 5e-4, 0.95)
        found = IdentifiedCurve.through([recording], points, Zeros(0.0), None).to_dict()
        assert found["curve"]["coulomb_n"] == pytest.approx(240.0, rel=0.1)
        assert (found["curve"]["static_n"] is not None) == known
        assert ("record" in found["why_not"]) != known


def test_a_curve_has_no_number_with_unknown_zeros_but_the_shift_of_its_sessions_has() -> None:
    speeds, curve = np.geomspace(7e-3, 0.1, 9).tolist(), StribeckCurve(240.0, 360.0, 2e-3, 1.5, 1500.0, 1.2)
    sessions = []
    for number, zero_n in enumerate((-12.0, 0.0, 12.0)):
        own = strokes(speeds, np.full(18, zero_n), curve)
        sessions.append(replace(own, metadata=replace(own.metadata, session=f"s{number}")))
    one = IdentifiedCurve.through(
        sessions[:1], stribeck_points(sessions[:1], 5e-4, 0.95), Zeros(np.inf, "zeros are not stated"), None
    )
    assert one.curve is None
    assert one.to_dict()["why_not"].startswith("zeros are not stated; at the slowest steady sliding")
    assert all(each.known_half_width_n is None for each in one.points)
    assert scatter_of_sessions(sessions[:1], CYLINDER, 0.95) == np.inf
    # Standard deviation 12 N, over the root of 3 sessions; Student's t with 2 degrees of freedom
    assert scatter_of_sessions(sessions, CYLINDER, 0.95) == pytest.approx(4.303 * 12.0 / 3.0**0.5, rel=0.02)
