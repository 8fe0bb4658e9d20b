import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.labelling.label import label
from cylinder_friction.labelling.uncertainty import label_uncertainty, smoothing_deviation
from cylinder_friction.recordings.mapping.channel_mapping import ChannelMapping, SensorScale, sensor_uncertainty
from cylinder_friction.recordings.recording import Recording, RecordingMetadata, SensorUncertainty
from cylinder_friction.signals.zero_phase import SavitzkyGolay, default_filter

CYLINDER = Cylinder(name="63/28", bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0)
A1, A2 = CYLINDER.piston_area_m2, CYLINDER.annulus_area_m2
NAT_8252 = SensorScale((0.0, 250.0), "bar", accuracy_percent=0.5)


def recording(uncertainty: dict[str, SensorUncertainty], **columns: list[float]) -> Recording:
    cells = {"pressure_1_pa": [0.0, 100e5], "pressure_2_pa": [50e5, 0.0], "position_m": [0.0, 0.1]} | columns
    metadata = RecordingMetadata("r", "1", "s", 0.005, uncertainty=uncertainty)
    return Recording(metadata, pd.DataFrame({"time_s": [0.0, 0.005]} | cells))


def expanded(of: Recording, load_uncertainty_n: float | NDArray[np.float64] = 0.0) -> NDArray[np.float64]:
    found = label_uncertainty(of, CYLINDER, load_uncertainty_n)
    assert found is not None
    assert found.shape == (len(of),)
    return found


def test_half_widths_of_a_data_sheet_in_newtons() -> None:
    stated = sensor_uncertainty({column: ChannelMapping(column, "bar", sensor=NAT_8252) for column in P})
    half_width_1 = stated["pressure_1_pa"].zero * math.sqrt(3.0) * A1
    half_width_2 = stated["pressure_2_pa"].zero * math.sqrt(3.0) * A2
    assert (half_width_1, half_width_2) == pytest.approx((390.0, 313.0), abs=1.0)
    # U = 2·√(390² + 313²)/√3 N
    np.testing.assert_allclose(expanded(recording(stated)), 577.0, atol=1.0)


P = ("pressure_1_pa", "pressure_2_pa")


def both(uncertainty: SensorUncertainty) -> dict[str, SensorUncertainty]:
    return dict.fromkeys(P, uncertainty)


def test_span_counts_with_the_reading() -> None:
    found = expanded(recording(both(SensorUncertainty(zero=0.0, span=0.01))))
    np.testing.assert_allclose(found, [2.0 * 0.5e5 * A2, 2.0 * 1e5 * A1])


def test_loads_add_in_quadrature() -> None:
    pressures = both(SensorUncertainty(1e4, 0.0))
    alone = 1e4 * math.hypot(A1, A2)
    measured = recording(pressures | {"load_force_n": SensorUncertainty(30.0, 0.0)}, load_force_n=[500.0, 600.0])
    np.testing.assert_allclose(expanded(measured), 2.0 * math.hypot(alone, 30.0))
    identified = expanded(recording(pressures), np.array([0.0, 40.0]))
    np.testing.assert_allclose(identified, [2.0 * alone, 2.0 * math.hypot(alone, 40.0)])


def test_drive_force_takes_the_place_of_missing_pressures() -> None:
    stated = {"drive_force_n": SensorUncertainty(3.0, 0.02)}
    table = pd.DataFrame({"time_s": [0.0, 1.0], "position_m": [0.0, 0.1], "drive_force_n": [0.0, 200.0]})
    motor = Recording(RecordingMetadata("r", "1", "s", 1.0, uncertainty=stated), table)
    np.testing.assert_allclose(expanded(motor), [6.0, 10.0])


def test_unknown_is_not_zero() -> None:
    assert label_uncertainty(recording({}), CYLINDER) is None
    assert label_uncertainty(recording({"pressure_1_pa": SensorUncertainty(1.0, 0.0)}), CYLINDER) is None
    loaded = recording(both(SensorUncertainty(1.0, 0.0)), load_force_n=[1.0, 2.0])
    assert label_uncertainty(loaded, CYLINDER) is None
    assert label_uncertainty(loaded, CYLINDER, 10.0) is not None


def test_what_smoothing_leaves_counts_in_quadrature() -> None:
    stated = both(SensorUncertainty(zero=1e3, span=0.0))
    without, smoothed = (
        label_uncertainty(recording(stated), CYLINDER, 0.0, each) for each in (0.0, np.array([0.0, 5.0]))
    )
    assert without is not None
    np.testing.assert_allclose(smoothed, np.hypot(without, [0.0, 10.0]))


def at_rest(p1: Array, p2: Array, uncertainty: dict[str, SensorUncertainty] | None = None) -> Recording:
    time_s = 0.005 * np.arange(len(p1))
    columns = {"time_s": time_s, "pressure_1_pa": p1, "pressure_2_pa": p2, "position_m": np.full(len(p1), 0.1)}
    return Recording(RecordingMetadata("r", "1", "s", 0.005, uncertainty=uncertainty or {}), pd.DataFrame(columns))


def test_smoothing_leaves_less_noise_than_there_was() -> None:
    noise_pa = 5e3 * np.random.default_rng(1).normal(size=(2, 4000))
    raw = at_rest(*noise_pa)
    noise_n = 5e3 * math.hypot(A1, A2)
    polynomial = smoothing_deviation(raw, CYLINDER, SavitzkyGolay())
    np.testing.assert_allclose(polynomial, 0.455 * noise_n, rtol=0.05)
    assert np.median(smoothing_deviation(raw, CYLINDER, default_filter(CYLINDER))) < 0.2 * noise_n


def test_steps_that_noise_spreads_count_as_noise_alone() -> None:
    step_pa = 6e3
    noise_pa = 5e3 * np.random.default_rng(2).normal(size=(2, 4000))

    def uncertainty(noise_share: float) -> float:
        p1, p2 = step_pa * np.rint((30e5 + noise_share * noise_pa) / step_pa)
        return expanded(at_rest(p1, p2, both(SensorUncertainty(0.0, 0.0, step_pa))))[0]

    assert uncertainty(1.0) == 0.0
    assert uncertainty(0.1) == pytest.approx(2.0 * step_pa / math.sqrt(12.0) * math.hypot(A1, A2))


@pytest.mark.parametrize("mass_kg", [6.0, 180.0])
def test_bounds_hold_friction_of_a_heavy_rod_that_changes_its_acceleration(mass_kg: float) -> None:
    step_s, random = 0.005, np.random.default_rng(0)
    time_s = step_s * np.arange(4000)
    shaken = np.mod(time_s, 5.0) < 0.5  # at 4 Hz, which the acceleration's window of 0.2 s cannot follow
    angle = 8.0 * np.pi * time_s
    position = 0.125 + 0.004 * np.where(shaken, np.sin(angle) ** 3, 0.0)
    acceleration = np.gradient(np.gradient(position, step_s), step_s)
    force = 300.0 + mass_kg * acceleration + random.normal(0.0, 10.0, len(time_s))
    columns = {"time_s": time_s, "pressure_1_pa": 20e5 + force / A1, "pressure_2_pa": np.full(4000, 20e5 * A1 / A2)}
    columns["position_m"] = position + random.normal(0.0, 2e-5, len(time_s))
    metadata = RecordingMetadata("r", "1", "s", step_s, uncertainty=both(SensorUncertainty(1e3, 0.0)))
    raw = Recording(metadata, pd.DataFrame(columns))
    (found,) = label([raw], replace(CYLINDER, moving_mass_kg=mass_kg))
    half_n, held = found.column("friction_uncertainty_n"), found.usable() & shaken
    assert np.mean(np.abs(found.column("friction_n") - 300.0)[held] <= half_n[held]) >= 0.9
    assert np.median(half_n[~shaken]) < 13.0
