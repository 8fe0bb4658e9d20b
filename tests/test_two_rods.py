"""A cylinder with a rod on both sides: areas, labels, estimators and what they carry; a plunger is refused."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylinder_friction.cylinder import ONE_CHAMBER, Cylinder
from cylinder_friction.deployment.c_export.compiled import CompiledEstimator
from cylinder_friction.deployment.c_export.export import export_c
from cylinder_friction.estimation.from_logs import estimate_logs
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.linear import ForceBalanceEstimator, LowPassForceBalanceEstimator
from cylinder_friction.friction_models.lugre import LuGre
from cylinder_friction.labelling.label import label
from cylinder_friction.realtime.trained_for import OtherCylinderError, TrainedFor
from cylinder_friction.recordings.checks.limits import CheckLimits
from cylinder_friction.recordings.checks.plausibility import check_friction
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording, RecordingError
from cylinder_friction.rig.friction import coulomb_friction
from cylinder_friction.rig.parameters import default_rig, friction_constants
from friction_samples import PLAIN_LUGRE
from made_recordings import made_recording, take_of_each_condition

ALIKE = Cylinder(bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0, rod_diameter_1_m=0.028)


def mirrored(recording: Recording) -> Recording:
    """Return the recording as seen from the other end of a cylinder with equal areas."""
    return recording.with_columns(
        pressure_1_pa=recording.column("pressure_2_pa"),
        pressure_2_pa=recording.column("pressure_1_pa"),
        position_m=ALIKE.stroke_m - recording.column("position_m"),
    )


def test_areas_are_the_bores_less_each_rods() -> None:
    wider = replace(ALIKE, rod_diameter_1_m=0.036)
    assert ALIKE.piston_area_m2 == ALIKE.annulus_area_m2
    assert wider.piston_area_m2 == pytest.approx(np.pi / 4.0 * (0.063**2 - 0.036**2))
    assert wider.annulus_area_m2 == ALIKE.annulus_area_m2 > wider.piston_area_m2


def test_a_second_rod_is_asked_for_before_pressures_are_called_swapped() -> None:
    time_s = 0.005 * np.arange(8000)
    force_n = 300.0 * (1.0 + 0.5 * np.sin(0.37 * time_s)) * np.sign(np.cos(time_s))
    one_rod = replace(ALIKE, rod_diameter_1_m=0.0)
    leaving_pa = 2e6 + 0.35 * force_n / (one_rod.piston_area_m2 - ALIKE.annulus_area_m2)
    columns = {"pressure_1_pa": leaving_pa + force_n / ALIKE.annulus_area_m2, "pressure_2_pa": leaving_pa}
    columns |= {"position_m": 0.12 + 0.05 * np.sin(time_s)}
    (found,) = check_friction(columns, 0.005, CheckLimits(one_rod, "none"))
    assert found.outcome == "refused"
    assert re.match(
        "with equal areas, .*: if the cylinder has a rod on both .*; if not, the pressures are sw", found.text
    )
    assert check_friction(columns, 0.005, CheckLimits(ALIKE, "none")) == []


def test_a_cylinder_with_one_rod_is_stored_as_before(cylinder: Cylinder) -> None:
    assert list(cylinder.to_dict()) == ["name", "bore_diameter_m", "rod_diameter_m", "stroke_m", "moving_mass_kg"]
    assert Cylinder(**ALIKE.to_dict()) == ALIKE  # type: ignore[arg-type]
    assert "rod_diameter_1_m" not in repr(cylinder)
    assert "rod_diameter_1_m" not in TrainedFor(0.063, 0.028, 300.0, 1e3).to_dict()


@settings(deadline=None, max_examples=10)
@given(seed=st.integers(0, 1000), condition=st.sampled_from("1234"))
def test_mirrored_motion_has_the_mirrored_label(seed: int, condition: str) -> None:
    recording = made_recording(ALIKE, condition=condition, seed=seed)
    (seen,), (turned,) = label([recording], ALIKE), label([mirrored(recording)], ALIKE)
    np.testing.assert_allclose(turned.column("friction_n"), -seen.column("friction_n"), atol=1e-6)
    np.testing.assert_array_equal(turned.usable(), seen.usable())
    away = seen.usable() & (np.abs(recording.column("velocity_m_s")) > 5e-3)
    error_n = seen.column("friction_n") - recording.column("friction_n")
    assert np.abs(error_n[away]).mean() < 10.0


@pytest.mark.parametrize(
    "estimator",
    [ForceBalanceEstimator(ALIKE, "none"), ForceBalanceEstimator(ALIKE, "paper"), LowPassForceBalanceEstimator(ALIKE)],
    ids=["unfiltered", "paper", "low-pass"],
)
def test_mirrored_motion_has_the_mirrored_estimate_also_in_c(estimator: FrictionEstimator, tmp_path: Path) -> None:
    recordings = take_of_each_condition(ALIKE, (1, 2))
    estimator.fit(recordings)
    estimator.calibrate(recordings[::2], recordings[1::2], ALIKE)
    estimator.save(tmp_path / "model")
    read = type(estimator).load(tmp_path / "model")
    recording = recordings[0]
    estimated_n = read.estimate(recording)
    np.testing.assert_array_equal(estimated_n, estimator.estimate(recording))
    np.testing.assert_allclose(read.estimate(mirrored(recording)), -estimated_n, atol=1e-6)
    exported = export_c(read, tmp_path / "c")
    in_c, _ = CompiledEstimator(exported).stream().run(mirrored(recording).samples())
    np.testing.assert_allclose(in_c[:, 0], -estimated_n, atol=1e-3)
    assert "63 mm bore and 28 mm rod and 28 mm rod on side 1" in exported.header.read_text(encoding="utf-8")
    assert read.trained_for is not None
    read.trained_for.refuse(replace(ALIKE, rod_diameter_1_m=0.0281))
    with pytest.raises(OtherCylinderError, match="rod on side 1, but the one given has 63 mm and 28 mm; train one"):
        read.trained_for.refuse(replace(ALIKE, rod_diameter_1_m=0.0))


def test_a_friction_model_of_equal_directions_is_mirrored() -> None:
    model, values = LuGre(pressure_scaled=True), replace(PLAIN_LUGRE, pressure_slope_n_pa=2e-5).packed()
    velocity_m_s, pressure_pa = 0.05 * np.sin(np.linspace(0.0, 20.0, 2000)), np.linspace(1e6, 8e6, 2000)
    forward, back = (
        model.simulate(values, sign * velocity_m_s, 0.005, model.new_state(), pressure_pa) for sign in (1.0, -1.0)
    )
    assert np.abs(forward).mean() > 100.0
    np.testing.assert_allclose(back, -forward, rtol=1e-12)


def test_the_rig_has_a_seal_on_either_rod(cylinder: Cylinder) -> None:
    one, two = (friction_constants(default_rig(each).friction) for each in (cylinder, ALIKE))
    assert coulomb_friction(two, 8e5, 60e5, 1.0, 40.0) == coulomb_friction(two, 60e5, 8e5, 1.0, 40.0)
    assert coulomb_friction(two, 0.0, 60e5, 1.0, 40.0) == coulomb_friction(one, 0.0, 60e5, 1.0, 40.0)


@pytest.mark.parametrize("field", ["rod_diameter_m", "rod_diameter_1_m"])
def test_a_plunger_is_refused_with_what_to_do(field: str) -> None:
    with pytest.raises(ValueError, match=rf"{field} must be smaller than bore_diameter_m \(0.063 m\)") as refused:
        replace(ALIKE, **{field: 0.063})  # type: ignore[arg-type]
    assert ONE_CHAMBER in str(refused.value)
    assert "map it as drive_force_n in place of both pressures" in ONE_CHAMBER
    with pytest.raises(ValueError, match=r"must be a positive number, or 0 without a rod on side 1, but got -0\.1"):
        replace(ALIKE, rod_diameter_1_m=-0.1)


def test_a_log_without_the_second_pressure_is_refused_and_its_advice_works(tmp_path: Path, cylinder: Cylinder) -> None:
    """The plunger lifts 1 kN: its pressure times area is friction, inertia and load."""
    recording = made_recording(cylinder, seconds=60.0)
    inertia_n = cylinder.moving_mass_kg * recording.column("acceleration_m_s2")
    force_n = recording.column("friction_n") + inertia_n + 1000.0
    position = recording.table[["time_s", "position_m"]]
    position.assign(pressure_1_pa=force_n / cylinder.piston_area_m2).to_csv(tmp_path / "pressure.csv", index=False)
    position.assign(drive_force_n=force_n).to_csv(tmp_path / "force.csv", index=False)
    recording.table[["time_s", *SAMPLE_COLUMNS]].to_csv(tmp_path / "both.csv", index=False)
    with pytest.raises(RecordingError, match="pressure_2_pa cannot be guessed") as refused:
        estimate_logs(tmp_path / "pressure.csv", cylinder, tmp_path / "friction")
    assert ONE_CHAMBER in str(refused.value)
    mapping = tmp_path / "mapping.yaml"
    columns = {"time_s": "s", "position_m": "m", "pressure_1_pa": "Pa"}
    text = "".join(f"  {name}: {{channel: {name}, unit: {unit}}}\n" for name, unit in columns.items())
    mapping.write_text(f"channels:\n{text}", encoding="utf-8")
    with pytest.raises(RecordingError, match="'pressure_2_pa' has no channel") as refused:
        estimate_logs(tmp_path / "pressure.csv", cylinder, tmp_path / "friction", channels=mapping)
    assert ONE_CHAMBER in str(refused.value)
    mapping.write_text(f"channels:\n{text.replace('pressure_1_pa', 'drive_force_n').replace('Pa', 'N')}", "utf-8")
    plunger = estimate_logs(tmp_path / "force.csv", cylinder, tmp_path / "plunger", channels=mapping, load="position")
    units = {"pressure": "Pa", "length": "m", "time": "s"}
    with pytest.warns(UserWarning, match="no mapping was given"):
        unloaded = estimate_logs(tmp_path / "both.csv", cylinder, tmp_path / "unloaded", units=units)
    assert plunger.recordings[0].friction_n == pytest.approx(unloaded.recordings[0].friction_n, rel=0.01)
