"""Viscous friction is told from pressure that changes with speed; candidate velocities follow strokes and rest."""

import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimation.identified_model import WIDEST, IdentifiedCurve, Zeros
from cylinder_friction.estimation.steady_intervals import lines_uncertain_n, steady_intervals, velocities_on_offer
from cylinder_friction.friction_models.identification.steady_points import StribeckPoint
from cylinder_friction.recordings.columns import PRESSURES
from cylinder_friction.recordings.line_loss import LineLoss
from cylinder_friction.recordings.recording import Recording, RecordingMetadata

STEP_S, VISCOUS_N_S_M = 0.005, 1500.0
SPEEDS_M_S = np.repeat(np.random.default_rng(3).permutation(np.geomspace(8e-3, 0.06, 15)), 200)


def strokes(slope_n_bar: float, back_bar_per_m_s: float, seed: int, fall_n: float = 0.0) -> Recording:
    """Strokes of a second at 15 speeds each way, each at a back pressure that grows with speed and varies by itself."""
    generator = np.random.default_rng(seed)
    speed, way = np.tile(SPEEDS_M_S, 2), np.tile(np.repeat([1.0, -1.0], 200), 15)
    own_bar = generator.normal(0.0, 0.002 if back_bar_per_m_s else 2.0, (15, 2))
    own_bar = np.repeat((own_bar - own_bar.mean(axis=0)).ravel(), 200)
    back_bar = 20.0 + back_bar_per_m_s * speed + own_bar
    friction_n = 300.0 + slope_n_bar * back_bar + VISCOUS_N_S_M * speed + generator.normal(0.0, 5.0, len(speed))
    friction_n = way * (friction_n + fall_n * np.exp(-speed / 0.02))
    pressures = {f"pressure_{side}_pa": 1e5 * back_bar for side in (1, 2)}
    columns = {"time_s": STEP_S * np.arange(len(speed)), "velocity_m_s": way * speed, "friction_n": friction_n}
    columns |= {"position_m": np.cumsum(way * speed) * STEP_S, "usable": np.ones(len(speed), dtype=np.bool_)}
    return Recording(RecordingMetadata("r", "1", "s", STEP_S), pd.DataFrame(columns | pressures))


@pytest.mark.parametrize(
    ("slope_n_bar", "back_bar_per_m_s", "known"), [(0.0, 0.0, True), (8.0, 0.0, True), (4.0, -150.0, False)]
)
def test_viscous_friction_is_told_from_pressure(
    cylinder: Cylinder, slope_n_bar: float, back_bar_per_m_s: float, known: bool
) -> None:
    logs = [[strokes(slope_n_bar, back_bar_per_m_s, seed)] for seed in range(20)]
    for bar, share in ((20.0, 0.9), (0.0, 0.8)):
        found = [steady_intervals(each, cylinder, 0.95, at_zero=bar == 0.0) for each in logs]
        narrow = [lower > 0.0 and upper < WIDEST * lower for lower, upper in (each["viscous_n_s_m"] for each in found)]
        assert abs(np.mean(narrow) - known) <= 0.1
        for name, value in (("viscous_n_s_m", VISCOUS_N_S_M), ("coulomb_n", 300.0 + bar * slope_n_bar)):
            assert not known or np.mean([each[name][0] <= value <= each[name][1] for each in found]) >= share, name
    still = strokes(0.0, 0.0, 0).with_columns(velocity_m_s=np.zeros(len(SPEEDS_M_S) * 2))
    assert steady_intervals([still], cylinder, 0.95)["coulomb_n"] == (-np.inf, np.inf)


def test_viscous_friction_is_held_from_the_coldest_oil_to_the_warmest(cylinder: Cylinder) -> None:
    """Each session has oil of its own; without its temperatures, the interval is that of a mixture."""
    oils_c, held, mixture = (24.0, 31.0, 38.0, 46.0), [], []
    viscous_n_s_m = [VISCOUS_N_S_M * math.exp(-0.035 * (oil_c - 40.0)) for oil_c in oils_c]
    for seed in range(20):
        logs = []
        for number, (oil_c, own_n_s_m) in enumerate(zip(oils_c, viscous_n_s_m, strict=True)):
            one = strokes(4.0, 0.0, 4 * seed + number)
            warmer_n = (own_n_s_m - VISCOUS_N_S_M) * one.column("velocity_m_s")
            measured_c = oil_c + np.random.default_rng(seed).normal(0.0, 0.05, len(one))
            logs.append(one.with_columns(friction_n=one.column("friction_n") + warmer_n, oil_temperature_c=measured_c))
        for found, known in ((held, logs), (mixture, [each.without_columns("oil_temperature_c") for each in logs])):
            lower, upper = steady_intervals(known, cylinder, 0.95)["viscous_n_s_m"]
            found.append(lower <= min(viscous_n_s_m) and max(viscous_n_s_m) <= upper)
            assert upper < 1.4 * max(viscous_n_s_m)
    assert np.mean(held) >= 0.9
    assert np.mean(mixture) <= 0.1


def test_few_strokes_do_not_tell_viscous_friction_from_a_slow_fall(cylinder: Cylinder) -> None:
    for seed in (1, 2, 3):
        recording = strokes(0.0, 0.0, seed, fall_n=60.0)
        few = recording.with_columns(usable=np.arange(len(recording)) < 2400)
        lower, upper = steady_intervals([few], cylinder, 0.95)["viscous_n_s_m"]
        assert lower <= VISCOUS_N_S_M <= upper


def test_intervals_hold_an_error_of_the_stated_loss_of_a_line(cylinder: Cylinder) -> None:
    recording = strokes(0.0, 0.0, 0)
    lines = {name: LineLoss(1.0, 0.06, laminar_percent=30.0, uncertainty_percent=50.0) for name in PRESSURES}
    recording = replace(recording, metadata=replace(recording.metadata, line_loss=lines))
    off_n = 0.8 * lines_uncertain_n(recording, cylinder, recording.column("velocity_m_s"))
    off_n *= np.sign(recording.column("velocity_m_s"))
    for friction_n in (recording.column("friction_n") + off_n, recording.column("friction_n") - off_n):
        found = steady_intervals([recording.with_columns(friction_n=friction_n)], cylinder, 0.95)
        assert found["viscous_n_s_m"][0] <= VISCOUS_N_S_M <= found["viscous_n_s_m"][1]
        assert found["coulomb_n"][0] <= 300.0 <= found["coulomb_n"][1]
    at = StribeckPoint(0.05, 300.0, 290.0, 310.0, 99, strokes=9, half_width_n=30.0)
    (line_n,) = lines_uncertain_n(recording, cylinder, np.array([0.05])).tolist()
    (point,) = IdentifiedCurve.through([recording], [at], Zeros(0.0), None, cylinder).points
    assert point.half_width_n == pytest.approx(line_n + 0.64 * 30.0)


def test_every_candidate_velocity_is_zero_at_standstill_and_follows_a_stroke() -> None:
    true, noise_m = np.concatenate([np.zeros(1000), np.full(400, 0.05), np.zeros(1000)]), 3e-5
    position_m = 0.1 + np.cumsum(true) * STEP_S + np.random.default_rng(1).normal(0.0, noise_m, len(true))
    table = pd.DataFrame({"time_s": STEP_S * np.arange(len(true)), "position_m": position_m, "drive_force_n": 0.0})
    measured = Recording(RecordingMetadata("r", "1", "s", STEP_S), table)
    offered = velocities_on_offer(noise_m, STEP_S)
    assert len(offered) == 8
    for words, velocity in offered.items():
        found = velocity(measured)
        assert np.mean(found[100:900] == 0.0) > 0.98, words
        assert found[1100:1300].mean() == pytest.approx(0.05, rel=0.01), words
