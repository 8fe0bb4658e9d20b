import json
import re

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.arrays import Array
from cylinder_friction.labelling.load import LoadPlan
from cylinder_friction.labelling.mass import MotionIdentification, identify_motion, missing_mass, motion_points
from cylinder_friction.labelling.session import identify_session
from cylinder_friction.labelling.strokes import stroke_points
from cylinder_friction.recordings.recording import Recording, RecordingError, RecordingMetadata
from cylinder_friction.signals.zero_phase import SavitzkyGolay

STEP_S = 0.002


def signals(
    mass_kg: float, noise_n: float, seed: int = 0, amplitude_m: float = 0.05, seconds: float = 20.0
) -> tuple[Array, Array, Array, Array]:
    """Return force, position, velocity and acceleration, filtered alike, of a motor-driven axis with friction."""
    generator = np.random.default_rng(seed)
    time_s = STEP_S * np.arange(round(seconds / STEP_S))
    phases = generator.uniform(0.0, 6.0, 3)
    rates = 2.0 * np.pi * np.array([0.3, 0.7, 1.3])
    angle = np.outer(time_s, rates) + phases
    position_m = 0.1 + amplitude_m * np.sin(angle).mean(axis=1)
    velocity = amplitude_m * (rates * np.cos(angle)).mean(axis=1)
    acceleration = -amplitude_m * (rates**2 * np.sin(angle)).mean(axis=1)
    force_n = mass_kg * acceleration + 200.0 * velocity + 20.0 * np.sign(velocity) - 3.0
    wander = np.convolve(generator.normal(0.0, noise_n, len(time_s) + 49), np.full(50, 1.0 / 50**0.5), mode="valid")
    chosen = SavitzkyGolay(0.02, 2, 0.02, 2, 0.02, 2)
    logged_m = position_m + generator.normal(0.0, 1e-7, len(time_s))
    return chosen.smooth_force(force_n + wander, STEP_S), position_m, *chosen.motion(logged_m, STEP_S)


def identified(mass_kg: float, noise_n: float, **how: float) -> MotionIdentification:
    force_n, position_m, velocity, acceleration = signals(mass_kg, noise_n, **how)  # type: ignore[arg-type]
    return identify_motion(motion_points(force_n, position_m, velocity, acceleration, STEP_S))


def test_mass_and_friction_are_found() -> None:
    found = identified(95.0, 1.0)
    assert found.mass_kg == pytest.approx(95.0, rel=0.01)
    assert found.viscous_n_s_m == pytest.approx(200.0, rel=0.03)
    assert found.coulomb_n == pytest.approx(20.0, rel=0.03)
    assert found.offset_n == pytest.approx(-3.0, abs=0.3)
    assert found.mass_known
    assert found.sentence().startswith("the moving mass was identified as 9")


def test_intervals_hold_the_truth_as_often_as_they_say() -> None:
    truth = {"mass_interval_kg": 95.0, "viscous_interval_n_s_m": 200.0, "coulomb_interval_n": 20.0}
    found = [identified(95.0, 10.0, seed=seed) for seed in range(40)]
    for name, value in truth.items():
        hits = [low <= value <= high for low, high in (getattr(each, name) for each in found)]
        assert np.mean(hits) >= 0.85, name
    assert np.mean([high - low for low, high in (each.mass_interval_kg for each in found)]) < 20.0


def test_standstill_does_not_count() -> None:
    """At rest any force below static friction may be seen; it says nothing of Coulomb friction."""
    force_n, position_m, velocity, acceleration = signals(95.0, 1.0)
    rest = 5000
    force_n = np.concatenate([force_n, np.linspace(-500.0, 500.0, rest)])
    position_m = np.concatenate([position_m, np.full(rest, position_m[-1])])
    velocity, acceleration = np.append(velocity, np.zeros(rest)), np.append(acceleration, np.zeros(rest))
    found = identify_motion(motion_points(force_n, position_m, velocity, acceleration, STEP_S))
    assert found.coulomb_n == pytest.approx(20.0, rel=0.05)


def test_too_little_motion_is_refused() -> None:
    points = motion_points(*signals(95.0, 1.0, seconds=1.5), STEP_S)
    with pytest.raises(RecordingError, match=r"got \d+ blocks of steady motion; expected at least 40"):
        identify_motion(points)


def test_a_session_keeps_the_given_mass_where_the_motion_does_not_tell_it() -> None:
    for noise_n, expected_kg in ((1.0, 95.0), (3000.0, 6.0)):
        blocks = motion_points(*signals(95.0, noise_n), STEP_S)
        found = identify_session([], [blocks], 6.0, LoadPlan())
        assert found.moving_mass_kg == pytest.approx(expected_kg, rel=0.02)
        assert json.loads(json.dumps(found.to_dict(), allow_nan=False))["motion"]["mass_known"] is (noise_n == 1.0)
    assert found.motion is not None
    assert found.motion.sentence().startswith("the motion does not determine the moving mass: got ")


def test_mass_and_load_are_found_beside_each_other() -> None:
    force_n, position_m, velocity, acceleration = signals(95.0, 1.0, seconds=40.0)
    force_n = force_n + 2000.0 + 3000.0 * position_m
    motion, plan = (force_n, position_m, velocity, acceleration), LoadPlan(slowest_m_s=0.02)
    usable = np.ones(len(force_n), dtype=np.bool_)
    strokes = stroke_points(*motion, force_n, usable, STEP_S, plan.slowest_m_s, plan.settling_travel_m)
    found = identify_session([strokes], [motion_points(*motion, STEP_S)], 6.0, plan)
    assert found.moving_mass_kg == pytest.approx(95.0, rel=0.03)
    assert found.load is not None
    grid = np.linspace(*found.load.range_m, 20)
    # The offset of -3 N is a load to all appearances.
    assert np.abs(found.load.load_n(grid) - (1997.0 + 3000.0 * grid)).max() < 15.0


@pytest.mark.parametrize(("left_kg", "stated_kg", "named"), [(95.0, 6.0, True), (2.0, 6.0, False), (40.0, 60.0, False)])
def test_a_mass_that_the_label_leaves_out_is_named(left_kg: float, stated_kg: float, named: bool) -> None:
    force_n, position_m, velocity_m_s, _ = signals(left_kg, 1.0)
    moved = {"position_m": position_m, "velocity_m_s": velocity_m_s, "drive_force_n": force_n, "friction_n": force_n}
    columns = pd.DataFrame({"time_s": STEP_S * np.arange(len(force_n)), **moved, "usable": True})
    words = missing_mass(Recording(RecordingMetadata("a", "1", "a", STEP_S), columns), stated_kg)
    assert (
        bool(re.match(r"friction changes with acceleration as 9\d to 9\d kg more than the stated 6 kg", words)) == named
    )
    assert bool(words) == named
