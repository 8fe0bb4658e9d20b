import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.friction_models.identification.intervals import confidence_intervals
from cylinder_friction.friction_models.identification.procedure import Identification, SearchEffort, identify
from cylinder_friction.friction_models.identification.search import Coordinates, search_locally
from cylinder_friction.friction_models.identification.simulation import Motion, Motions
from cylinder_friction.friction_models.identification.steady_points import steady_points
from cylinder_friction.friction_models.lugre import LuGre, LugreParameters
from cylinder_friction.recordings.recording import Recording, RecordingMetadata
from friction_samples import lugre_to_find, new_bristle, simulate

SAMPLE_TIME_S = 0.005
FINE = 20
DEAD_BAND_M_S = 6e-4


def with_dead_band(velocity_m_s: np.ndarray, dead_band_m_s: float) -> np.ndarray:
    """Return the velocity with everything slower than the dead band set to zero."""
    return np.where(np.abs(velocity_m_s) < dead_band_m_s, 0.0, velocity_m_s)


def synthetic_recording(
    truth: LugreParameters, seed: int, seconds: float = 30.0, noise_n: float = 10.0, fine: int = FINE
) -> Recording:
    """Return strokes at log-spaced speeds both ways, with pauses; friction simulated at 4 kHz, label with noise."""
    generator = np.random.default_rng(seed)
    sample_time_s = fine * SAMPLE_TIME_S / FINE
    rows = round(seconds / sample_time_s)
    targets: list[float] = []
    while len(targets) < rows * fine:
        speed = float(np.exp(generator.uniform(np.log(1e-3), np.log(0.12)))) * (-1.0) ** int(generator.integers(2))
        held, paused = (int(length * 4000) for length in (generator.uniform(0.4, 1.0), generator.uniform(0.0, 0.3)))
        targets += [speed] * held + [0.0] * paused
    width = 400  # 0.1 s from one speed to the next
    smooth = np.convolve(targets[: rows * fine], np.hanning(width) / np.hanning(width).sum(), mode="same")
    time_s = sample_time_s * np.arange(rows)
    pressure_2 = 1e6 + 5e5 * np.sin(0.7 * time_s + seed)
    pressure_1 = 5e5 + 4e5 * np.sin(1.3 * time_s)
    fine_pressure = np.repeat(pressure_1 + pressure_2, fine)
    friction = simulate(truth, smooth, sample_time_s / fine, new_bristle(), fine_pressure)[fine - 1 :: fine]
    table = pd.DataFrame(
        {
            "time_s": time_s,
            "pressure_1_pa": pressure_1,
            "pressure_2_pa": pressure_2,
            "position_m": 0.125 + np.cumsum(smooth)[fine - 1 :: fine] * sample_time_s / fine,
            "velocity_m_s": smooth[fine - 1 :: fine],
            "friction_n": friction + generator.normal(0.0, noise_n, rows),
            "usable": time_s > 0.5,
        }
    )
    return Recording(RecordingMetadata(f"r{seed}", "1", f"s{seed}", sample_time_s), table)


def identified(
    recordings: list[Recording], mass_kg: float, with_pressure: bool, effort: SearchEffort
) -> Identification:
    return identify(
        LuGre(with_pressure),
        recordings,
        {"exact": lambda recording: with_dead_band(recording.column("velocity_m_s"), DEAD_BAND_M_S)},
        (lambda recording: recording.samples()[:, :2].sum(axis=1)) if with_pressure else None,
        effort,
        mass_kg=mass_kg,
        damping_ratio=0.5,
        dead_band_m_s=DEAD_BAND_M_S,
        confidence=0.95,
    )


@pytest.fixture(scope="module")
def plain_recordings(cylinder: Cylinder) -> list[Recording]:
    return [synthetic_recording(lugre_to_find(cylinder.moving_mass_kg), seed) for seed in range(4)]


def test_steady_points_lie_on_the_curve(cylinder: Cylinder, plain_recordings: list[Recording]) -> None:
    points = steady_points(plain_recordings, DEAD_BAND_M_S)
    curve = lugre_to_find(cylinder.moving_mass_kg).curve
    velocity = np.array([point.velocity_m_s for point in points])
    friction = np.array([point.friction_n for point in points])
    assert min((velocity < 0.0).sum(), (velocity > 0.0).sum()) >= 6
    assert np.all(np.diff(velocity) > 0.0)
    assert np.abs(friction - curve.friction(velocity)).max() < 15.0
    assert all(point.lower_quartile_n <= point.friction_n <= point.upper_quartile_n for point in points)


def test_known_parameters_come_back_from_noisy_labels(cylinder: Cylinder, plain_recordings: list[Recording]) -> None:
    truth = lugre_to_find(cylinder.moving_mass_kg)
    found = identified(plain_recordings, cylinder.moving_mass_kg, False, SearchEffort(1, 6, 12, 2))
    assert isinstance(found.parameters, LugreParameters)
    assert found.parameters.coulomb_n == pytest.approx(truth.coulomb_n, rel=0.02)
    assert found.parameters.static_n == pytest.approx(truth.static_n, rel=0.05)
    assert found.parameters.stribeck_velocity_m_s == pytest.approx(truth.stribeck_velocity_m_s, rel=0.1)
    assert found.parameters.viscous_n_s_m == pytest.approx(truth.viscous_n_s_m, rel=0.03)
    assert found.parameters.retract_ratio == pytest.approx(truth.retract_ratio, rel=0.02)
    assert found.parameters.bristle_stiffness_n_m == pytest.approx(truth.bristle_stiffness_n_m, rel=0.5)
    assert found.parameters.is_passive()
    # Normal noise of 10 N has a mean absolute value of 8 N, which no parameters can undo.
    assert found.error_n < 1.25 * 10.0 * np.sqrt(2.0 / np.pi)
    assert ", ".join(sorted(found.intervals)) == (
        "bristle_stiffness_n_m, coulomb_n, retract_ratio, static_n, stribeck_exponent, stribeck_velocity_m_s, "
        "viscous_n_s_m"
    )


def test_the_pressure_slope_comes_back(cylinder: Cylinder) -> None:
    truth = lugre_to_find(cylinder.moving_mass_kg, slope_n_pa=4e-5)
    recordings = [synthetic_recording(truth, seed) for seed in range(3)]
    found = identified(recordings, cylinder.moving_mass_kg, True, SearchEffort(1, 6, 12, 2))
    assert isinstance(found.parameters, LugreParameters)
    assert found.parameters.pressure_slope_n_pa == pytest.approx(4e-5, rel=0.1)
    assert found.parameters.coulomb_n == pytest.approx(240.0, rel=0.05)
    assert "pressure_slope_n_pa" in found.intervals


def test_fast_recordings_are_searched_at_a_step_of_5_ms(cylinder: Cylinder, monkeypatch: pytest.MonkeyPatch) -> None:
    truth, steps_s = lugre_to_find(cylinder.moving_mass_kg), list[float]()
    fast = [synthetic_recording(truth, seed, fine=4) for seed in range(2)]
    error_of = Motions.error_of

    def counted(self: Motions, values: np.ndarray) -> float:
        steps_s.append(self.sample_time_s)
        return error_of(self, values)

    monkeypatch.setattr(Motions, "error_of", counted)
    found = identified(fast, cylinder.moving_mass_kg, False, SearchEffort(1, 4, 4, 2))
    assert {fast[0].sample_time_s, *steps_s} == {0.001, 0.005}
    assert steps_s.count(0.001) == 1
    assert found.parameters.value("coulomb_n") == pytest.approx(truth.coulomb_n, rel=0.02)
    assert found.parameters.value("viscous_n_s_m") == pytest.approx(truth.viscous_n_s_m, rel=0.03)
    assert found.parameters.value("bristle_stiffness_n_m") == pytest.approx(truth.bristle_stiffness_n_m, rel=0.5)
    assert found.error_n < 1.25 * 10.0 * np.sqrt(2.0 / np.pi)


@pytest.mark.extended
def test_intervals_hold_the_truth_about_as_often_as_they_say(cylinder: Cylinder) -> None:
    """Where the model is right, 80 % intervals of Coulomb friction, viscosity and ratio hold it most of the time."""
    truth = lugre_to_find(cylinder.moving_mass_kg)
    names = ("coulomb_n", "viscous_n_s_m", "retract_ratio")
    inside = 0
    for seed in range(8):
        recordings = [synthetic_recording(truth, 100 + seed, noise_n=20.0)]
        found = identified(recordings, cylinder.moving_mass_kg, False, SearchEffort(1, 2, 1, 1))
        velocity = with_dead_band(recordings[0].column("velocity_m_s"), DEAD_BAND_M_S)
        motions = Motions.of(
            [Motion(velocity, np.zeros(len(velocity)), recordings[0].column("friction_n"), recordings[0].usable())],
            SAMPLE_TIME_S,
            LuGre(),
        )
        intervals = confidence_intervals(motions, found.parameters, tuple(found.intervals), 0.8)
        inside += sum(intervals[name][0] <= getattr(truth, name) <= intervals[name][1] for name in names)
    assert 12 <= inside <= 24


def test_intervals_hold_the_scatter_of_whole_recordings(cylinder: Cylinder) -> None:
    """Dry friction differs by 5 % from session to session, as with the oil's temperature, and by little within one."""
    truth, generator = lugre_to_find(cylinder.moving_mass_kg), np.random.default_rng(0)
    velocity, motions = 0.05 * np.sin(2.0 * SAMPLE_TIME_S * np.arange(4000)), []
    levels = generator.permutation(np.linspace(0.95, 1.05, 6))
    for level in levels:
        own = replace(truth, coulomb_n=level * truth.coulomb_n, static_n=level * truth.static_n)
        friction = simulate(own, velocity, SAMPLE_TIME_S, new_bristle()) + generator.normal(0.0, 5.0, 4000)
        motions.append(Motion(velocity, np.zeros(4000), friction, np.arange(4000) > 200))
    both = [
        confidence_intervals(Motions.of(motions, SAMPLE_TIME_S, LuGre()), truth, ("coulomb_n",), 0.95, 0.0, differ)
        for differ in (False, True)
    ]
    alike, different = (0.5 * math.log(each["coulomb_n"][1] / each["coulomb_n"][0]) for each in both)
    expected = 2.57 * float(np.std(levels, ddof=1)) / math.sqrt(6.0)
    assert 0.7 * expected < different < 3.0 * expected
    assert alike < 0.5 * different


def test_what_the_motion_says_nothing_about_gets_a_wide_interval(cylinder: Cylinder) -> None:
    truth = lugre_to_find(cylinder.moving_mass_kg)
    velocity = np.full(4000, 0.1)
    friction = simulate(truth, velocity, SAMPLE_TIME_S, new_bristle())
    label = friction + np.random.default_rng(0).normal(0.0, 5.0, len(velocity))
    motions = Motions.of([Motion(velocity, np.zeros(4000), label, np.arange(4000) > 1000)], SAMPLE_TIME_S, LuGre())
    interval = confidence_intervals(motions, truth, ("coulomb_n", "retract_ratio"), 0.95)
    assert interval["retract_ratio"][1] / interval["retract_ratio"][0] == pytest.approx(1e6)
    assert interval["coulomb_n"][1] / interval["coulomb_n"][0] < 1.05


def test_every_corner_of_the_search_is_physical_and_passive(cylinder: Cylinder) -> None:
    coordinates = Coordinates.around(LuGre(True), lugre_to_find(6.0).curve, cylinder.moving_mass_kg, 0.5, 1.5e6)
    generator = np.random.default_rng(0)
    for _ in range(200):
        corner = np.where(generator.random(8) < 0.5, coordinates.lower, coordinates.upper)
        parameters = coordinates.parameters(corner)
        assert isinstance(parameters, LugreParameters)
        assert parameters.is_passive()


def test_a_local_search_ends_at_the_same_error_from_soft_and_from_stiff_bristles(cylinder: Cylinder) -> None:
    truth = lugre_to_find(cylinder.moving_mass_kg)
    recording = synthetic_recording(truth, 0)
    velocity = with_dead_band(recording.column("velocity_m_s"), DEAD_BAND_M_S)
    motion = Motion(velocity, np.zeros(len(velocity)), recording.column("friction_n"), recording.usable())
    motions = Motions.of([motion], SAMPLE_TIME_S, LuGre())
    coordinates = Coordinates.around(LuGre(), truth.curve, cylinder.moving_mass_kg, 0.5)
    starts = [coordinates.start(truth.curve, factor * truth.bristle_stiffness_n_m) for factor in (0.1, 20.0)]
    ends = [search_locally(motions, coordinates, start, 400) for start in starts]
    errors_n = [motions.error_of(coordinates.values(end)) for end in ends]
    assert errors_n[0] == pytest.approx(errors_n[1], rel=1e-3)
    assert max(errors_n) < motions.error_of(truth.packed())
    assert all(np.all((coordinates.lower <= end) & (end <= coordinates.upper)) for end in ends)
