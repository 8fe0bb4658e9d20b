import json
import re

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.labelling.load import LoadPlan
from cylinder_friction.labelling.mass import MotionIdentification, identify_motion, missing_mass, motion_points
from cylinder_friction.labelling.session import identify_session
from cylinder_friction.labelling.strokes import stroke_points
from cylinder_friction.recordings.recording import Recording, RecordingError, RecordingMetadata
from cylinder_friction.signals.zero_phase import SavitzkyGolay

STEP_S = 0.002


def signals(
    mass_kg: float, noise_n: float, seed: int = 0, amplitude_m: float = 0.05, seconds: float = 20.0
) -> tuple[Array, Array, Array]:
    """Return raw force and position of a motor-driven axis with friction, and its smooth velocity."""
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
    logged_m = position_m + generator.normal(0.0, 1e-7, len(time_s))
    return force_n + wander, logged_m, SavitzkyGolay(0.02, 2, 0.02, 2, 0.02, 2).motion(logged_m, STEP_S)[0]


def identified(mass_kg: float, noise_n: float, **how: float) -> MotionIdentification:
    return identify_motion(motion_points(*signals(mass_kg, noise_n, **how), STEP_S))  # type: ignore[arg-type]


def test_the_mass_is_found() -> None:
    found = identified(95.0, 1.0)
    assert found.mass_kg == pytest.approx(95.0, rel=0.01)
    assert found.mass_known
    assert found.sentence().startswith("the moving mass was identified as 9")


def test_intervals_hold_the_truth_as_often_as_they_say() -> None:
    intervals = [identified(95.0, 10.0, seed=seed).mass_interval_kg for seed in range(40)]
    assert np.mean([low <= 95.0 <= high for low, high in intervals]) >= 0.85
    assert np.median([high - low for low, high in intervals]) < 30.0


def test_one_window_sees_force_and_acceleration_alike() -> None:
    """A coarse position and few samples blur acceleration; the force is blurred as much."""
    force_n, position_m, velocity_m_s = signals(95.0, 0.1, amplitude_m=0.2, seconds=60.0)
    rough_m = np.round(position_m / 1e-4) * 1e-4
    every = slice(None, None, 10)
    found = identify_motion(motion_points(force_n[every], rough_m[every], velocity_m_s[every], 10 * STEP_S))
    assert found.mass_kg == pytest.approx(95.0, rel=0.02)


def test_friction_that_lags_widens_the_interval() -> None:
    """Falling friction that follows the speed 20 ms late is mass to all appearances: 95 kg and some."""
    force_n, position_m, velocity_m_s = signals(95.0, 1.0, seconds=40.0)
    late_m_s = np.roll(velocity_m_s, round(0.02 / STEP_S))
    falling_n = np.sign(velocity_m_s) * 80.0 * np.exp(-np.abs(late_m_s) / 0.03)
    found = identify_motion(motion_points(force_n + falling_n, position_m, velocity_m_s, STEP_S))
    low, high = found.mass_interval_kg
    low_without, high_without = identified(95.0, 1.0, seconds=40.0).mass_interval_kg
    assert low <= 95.0 <= high
    assert high - low > 3.0 * (high_without - low_without)


def test_standstill_does_not_count() -> None:
    """At rest any force below static friction may be seen."""
    force_n, position_m, velocity = signals(95.0, 1.0)
    rest = 5000
    force_n = np.concatenate([force_n, np.linspace(-500.0, 500.0, rest)])
    position_m = np.concatenate([position_m, np.full(rest, position_m[-1])])
    found = identify_motion(motion_points(force_n, position_m, np.append(velocity, np.zeros(rest)), STEP_S))
    assert found.mass_kg == pytest.approx(95.0, rel=0.01)


def test_too_little_motion_is_refused() -> None:
    points = motion_points(*signals(95.0, 1.0, seconds=1.5), STEP_S)
    with pytest.raises(RecordingError, match=r"got \d+ windows of 0.2 s that slide more than 10 mm .* at least 40"):
        identify_motion(points)


def test_a_session_keeps_the_given_mass_where_the_motion_does_not_tell_it() -> None:
    for noise_n, expected_kg in ((1.0, 95.0), (3000.0, 6.0)):
        windows = motion_points(*signals(95.0, noise_n), STEP_S)
        found = identify_session([], [windows], 6.0, LoadPlan())
        assert found.moving_mass_kg == pytest.approx(expected_kg, rel=0.02)
        motion = json.loads(json.dumps(found.to_dict(), allow_nan=False))["motion"]
        assert motion["mass_known"] is (noise_n == 1.0)
        assert (motion["mass_kg"] is None) is (motion["mass_interval_kg"] is None) is (noise_n == 3000.0)
    assert found.motion is not None
    assert re.match(r"the motion does not determine the moving mass to ± 30 %; [^\d]*$", found.motion.sentence())


def test_mass_and_load_are_found_beside_each_other() -> None:
    force_n, position_m, velocity = signals(95.0, 1.0, seconds=40.0)
    force_n, plan = force_n + 2000.0 + 3000.0 * position_m, LoadPlan(slowest_m_s=0.02)
    chosen = SavitzkyGolay(0.02, 2, 0.02, 2, 0.02, 2)
    motion = (chosen.smooth_force(force_n, STEP_S), position_m, *chosen.motion(position_m, STEP_S))
    usable = np.ones(len(force_n), dtype=np.bool_)
    strokes = stroke_points(*motion, force_n, usable, STEP_S, plan.slowest_m_s, plan.settling_travel_m)
    found = identify_session([strokes], [motion_points(force_n, position_m, velocity, STEP_S)], 6.0, plan)
    assert found.moving_mass_kg == pytest.approx(95.0, rel=0.03)
    assert found.load is not None
    grid = np.linspace(*found.load.range_m, 20)
    # The offset of -3 N is a load to all appearances.
    assert np.abs(found.load.load_n(grid) - (1997.0 + 3000.0 * grid)).max() < 15.0


@pytest.mark.parametrize(
    ("true_kg", "stated_kg", "named"), [(101.0, 6.0, True), (8.0, 6.0, False), (100.0, 60.0, False)]
)
def test_a_mass_that_the_label_leaves_out_is_named(true_kg: float, stated_kg: float, named: bool) -> None:
    force_n, position_m, velocity_m_s = signals(true_kg, 1.0)
    label_n = force_n - stated_kg * np.gradient(velocity_m_s, STEP_S)
    moved = {"position_m": position_m, "velocity_m_s": velocity_m_s, "drive_force_n": force_n, "friction_n": label_n}
    columns = pd.DataFrame({"time_s": STEP_S * np.arange(len(force_n)), **moved, "usable": True})
    cylinder = Cylinder(bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=stated_kg)
    words = missing_mass(Recording(RecordingMetadata("a", "1", "a", STEP_S), columns), cylinder)
    assert (
        bool(re.match(r"friction changes with acceleration as 9\d to 9\d kg more than the stated 6 kg", words)) == named
    )
    assert bool(words) == named
