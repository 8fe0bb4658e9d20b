from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.labelling.offset_identification import OffsetModel, fit_offset_model, offset_model
from cylinder_friction.labelling.sliding_blocks import SlidingBlocks, zero_uncertainty_n
from cylinder_friction.recordings.recording import Recording, RecordingError, RecordingMetadata, SensorUncertainty

STEP_S, DURATION_S = 0.01, 40.0
ZERO_PA = 3000.0
AREAS_M2 = (np.pi * 0.063**2 / 4.0, -np.pi * (0.063**2 - 0.028**2) / 4.0)
LIFT = Cylinder(bore_diameter_m=0.1, rod_diameter_m=0.07, stroke_m=0.5, moving_mass_kg=430.0)
CELL = {"load_force_n": SensorUncertainty(5.0, 0.0, zeroed=True)}
PRESSURES = {name: SensorUncertainty(ZERO_PA, 0.0, zeroed=True) for name in ("pressure_1_pa", "pressure_2_pa")}


def sliding(
    cylinder: Cylinder,
    session: str,
    offset_n: float = 0.0,
    *,
    asymmetry: float = 0.1,
    level: float = 1.0,
    seed: int = 0,
    only_out: bool = False,
    drive: bool = False,
    uncertainty: Any = None,
    condition: str = "1",
    **columns: float,
) -> Recording:
    """Return a labelled recording of strokes up and down, of known friction and offset."""
    generator = np.random.default_rng([seed, *session.encode()])
    time_s = np.arange(0.0, DURATION_S, STEP_S)
    period_s = generator.uniform(3.0, 5.0)
    velocity = 0.05 * np.sin(2.0 * np.pi * time_s / period_s) * (1.0 + 0.5 * np.sin(0.3 * time_s))
    position_m = 0.08 + np.cumsum(velocity) * STEP_S
    if only_out:
        velocity = np.abs(velocity)
    rod_pa = 1e6 + 1e6 * (velocity > 0.0) + 2e5 * np.sin(time_s)
    seals_n = 200.0 + 8.0 * (rod_pa / 1e5) ** 0.8
    friction_n = level * (np.sign(velocity) - asymmetry) * seals_n + 800.0 * velocity
    label_n = friction_n + offset_n + generator.normal(0.0, 5.0, len(time_s))
    table = {"time_s": time_s, "position_m": position_m, "velocity_m_s": velocity, "friction_n": label_n}
    if drive:
        table["drive_force_n"] = label_n
    else:
        table["pressure_2_pa"] = rod_pa
        table["pressure_1_pa"] = (label_n + rod_pa * cylinder.annulus_area_m2) / cylinder.piston_area_m2
    table |= {name: np.full(len(time_s), value) for name, value in columns.items()}
    stated = ({"drive_force_n": SensorUncertainty(12.0, 0.0, zeroed=True)} if drive else PRESSURES) | (
        uncertainty or {}
    )
    metadata = RecordingMetadata(f"{session}_{seed}", condition, session, STEP_S, cylinder.name, uncertainty=stated)
    return Recording(metadata, pd.DataFrame(table))


def campaign(cylinder: Cylinder, count: int = 12, asymmetry_sd: float = 0.0, **each: Any) -> dict[str, Recording]:
    """Return one recording of each session, with offsets of 12 N and levels of 3 % rms; keys are exact offsets."""
    generator = np.random.default_rng(3)
    offsets_n = 12.0 * generator.standard_normal(count)
    levels = 1.0 + 0.03 * generator.standard_normal(count)
    asymmetries = 0.1 + 0.5 * asymmetry_sd * generator.standard_normal(count)
    return {
        repr(float(offset_n)): sliding(
            cylinder, f"s{number:02d}", offset_n, level=float(level), asymmetry=float(own), **each
        )
        for number, (offset_n, level, own) in enumerate(zip(offsets_n, levels, asymmetries, strict=True))
    }


def lifting(number: int, bar: float, offset_n: float) -> SlidingBlocks:
    """Return a session at nearly constant pressures; their noise is in the label and in the pressures."""
    generator, strokes, blocks = np.random.default_rng(number), 20, 20
    direction = np.repeat(np.tile([1.0, -1.0], strokes // 2), blocks)
    speed_m_s = np.repeat(generator.uniform(0.02, 0.2, strokes), blocks)
    noise_bar = 0.016 * generator.standard_normal((2, strokes * blocks))
    friction_n = (280.0 + 6.0 * bar) * np.where(direction > 0.0, 0.94, 1.06) + 770.0 * speed_m_s
    noise_n = 1e5 * (LIFT.piston_area_m2 * noise_bar[0] - LIFT.annulus_area_m2 * noise_bar[1])
    columns = {name: 1e5 * (bar + own) for name, own in zip(PRESSURES, noise_bar, strict=False)}
    columns["velocity_m_s"], columns["position_m"] = (
        direction * speed_m_s,
        np.tile(np.linspace(0.05, 0.45, blocks), strokes),
    )
    label_n = direction * friction_n + offset_n + noise_n
    stroke = np.repeat(np.arange(strokes), blocks)
    return SlidingBlocks(f"s{number}", 104.0, 0.0, 40.0, label_n, direction, stroke, columns)


def errors(model: OffsetModel, recordings: dict[str, Recording]) -> tuple[np.ndarray, np.ndarray]:
    """Return offset less truth of every session, both less their mean, and in stated uncertainties."""
    found = [model.sessions[recording.metadata.session] for recording in recordings.values()]
    error = np.array([each.offset_n for each in found]) - np.array([float(offset) for offset in recordings])
    error -= error.mean()
    return error, error / np.array([each.relative_uncertainty_n for each in found])


def without_noise(cylinder: Cylinder) -> dict[str, Recording]:
    """Return a campaign as of a simulation, which friction common to all sessions explains to the last digit."""
    return {
        offset: recording.with_columns(friction_n=300.0 * np.sign(recording.column("velocity_m_s")) + float(offset))
        for offset, recording in campaign(cylinder).items()
    }


def unevenly_loaded(cylinder: Cylinder) -> dict[str, Recording]:
    """Sessions differ by the load that they carry most of the time; a hundredth of it is in the label either way."""
    recordings = {}
    for number, (offset, recording) in enumerate(campaign(cylinder, uncertainty=CELL).items()):
        load_n = 1000.0 * (-1.0) ** number + 1500.0 * np.sin(0.7 * recording.column("time_s"))
        label_n = recording.column("friction_n") + 0.01 * load_n
        recordings[offset] = recording.with_columns(load_force_n=load_n, friction_n=label_n)
    return recordings


@pytest.mark.parametrize(
    ("made", "rms_n"),
    [(campaign, 1.5), (partial(campaign, drive=True), 1.5), (without_noise, 1.5), (unevenly_loaded, 2.0)],
    ids=["pressures", "drive force", "without noise", "an uneven load, or one that is read too large"],
)
def test_offsets_of_sessions_are_found_together(
    made: Callable[[Cylinder], dict[str, Recording]], rms_n: float, cylinder: Cylinder
) -> None:
    recordings = made(cylinder)
    error, ratio = errors(fit_offset_model(recordings.values(), cylinder), recordings)
    assert np.sqrt(np.mean(error**2)) < rms_n
    assert np.abs(ratio).max() < 3.0


def test_the_load_cell_takes_the_share_of_an_offset_that_its_zero_makes_likely(cylinder: Cylinder) -> None:
    cell = {"load_force_n": SensorUncertainty(9.0, 0.0, zeroed=True)}
    recordings = list(campaign(cylinder, uncertainty=cell, load_force_n=100.0).values())
    model = fit_offset_model(recordings, cylinder)
    (corrected,) = model.corrected(recordings[:1])
    found, zeros = model.sessions["s00"], corrected.metadata.identified_zero
    assert found.prior_n == pytest.approx(np.hypot(ZERO_PA * np.hypot(*AREAS_M2), 9.0), rel=1e-4)
    assert zeros["load_force_n"].offset == pytest.approx(-found.offset_n * 81.0 / found.prior_n**2)
    taken_n = (corrected.column("load_force_n") - corrected.zeroed().column("load_force_n"))[0]
    assert taken_n == pytest.approx(zeros["load_force_n"].offset)
    pressures_n = sum(zeros[name].offset * area for name, area in zip(PRESSURES, AREAS_M2, strict=True))
    assert pressures_n - taken_n == pytest.approx(found.offset_n)


def test_a_further_session_is_identified_without_the_others(cylinder: Cylinder) -> None:
    """It is what a joint fit finds too, and the model stays as it was."""
    recordings = campaign(cylinder)
    (*others, last), joint = recordings.values(), fit_offset_model(recordings.values(), cylinder)
    model = fit_offset_model(others, cylinder)
    before = repr(model)
    found, together = model.identify([last]), joint.sessions[last.metadata.session]
    assert found.offset_n == pytest.approx(together.offset_n, abs=1.0)
    assert found.standard_uncertainty_n == pytest.approx(together.standard_uncertainty_n, rel=0.2)
    assert repr(model) == before
    assert last.metadata.session not in model.sessions


def test_an_asymmetry_far_beyond_the_plan_is_no_offset(cylinder: Cylinder) -> None:
    """Sessions that differ by three times as much as their zeros explain show little of these, which is stated."""
    recordings = campaign(cylinder, 24, asymmetry_sd=0.25)
    model = fit_offset_model(recordings.values(), cylinder)
    error, ratio = errors(model, recordings)
    assert np.sqrt(np.mean(error**2)) < 1.1 * np.std([float(each) for each in recordings])
    assert np.mean(np.abs(ratio) < 2.0) >= 0.9
    assert model.plan.asymmetry_sd == pytest.approx(0.25, rel=0.5)


def test_a_session_whose_friction_drives_the_piston_says_nothing_about_asymmetry(cylinder: Cylinder) -> None:
    recordings = [*campaign(cylinder).values(), sliding(cylinder, "reversed", 60.0, level=-0.3)]
    assert fit_offset_model(recordings, cylinder).plan.asymmetry == pytest.approx(0.15)


def test_the_mean_of_all_sessions_stays_as_uncertain_as_the_zeros(cylinder: Cylinder) -> None:
    recordings = [sliding(cylinder, f"s{number}", 10.0) for number in range(9)]
    model = fit_offset_model(recordings, cylinder)
    zero_n = zero_uncertainty_n(recordings[0], cylinder)
    assert zero_n == pytest.approx(np.hypot(cylinder.piston_area_m2, cylinder.annulus_area_m2) * ZERO_PA)
    assert model.common_uncertainty_n == pytest.approx(zero_n / 3.0, rel=0.02)
    for each in model.sessions.values():
        assert abs(each.offset_n) < 3.0  # an offset common to all looks like asymmetry
        assert each.common_uncertainty_n == model.common_uncertainty_n < each.standard_uncertainty_n


@pytest.mark.parametrize("count", [1, 3, 12])
@pytest.mark.parametrize("zero_pa", [5e3, 50e3, 500e3], ids=["small", "like friction", "large"])
def test_a_zero_that_sensors_keep_is_one_draw_in_any_number_of_sessions(
    zero_pa: float, count: int, cylinder: Cylinder
) -> None:
    kept = {name: SensorUncertainty(zero_pa, 0.0) for name in PRESSURES}
    offset_n = 1.5 * cylinder.piston_area_m2 * zero_pa
    sessions = [sliding(cylinder, f"s{number}", offset_n, uncertainty=kept) for number in range(count)]
    model = fit_offset_model(sessions, cylinder)
    friction_n, further = model.level_n, model.identify([sliding(cylinder, "new", offset_n, uncertainty=kept)])
    for each in (*model.sessions.values(), further):
        smallest_n = min(each.prior_n, model.plan.asymmetry * friction_n)
        assert each.common_uncertainty_n > 0.6 * smallest_n  # no number of sessions averages it away
        assert abs(each.offset_n - offset_n) < 2.0 * each.standard_uncertainty_n
        assert each.standard_uncertainty_n < 1.2 * each.prior_n


def test_zeros_that_change_are_followed_about_the_one_that_sensors_keep(cylinder: Cylinder) -> None:
    kept = {name: SensorUncertainty(15e3, 0.0) for name in PRESSURES}
    recordings = campaign(cylinder, uncertainty=kept)
    shifted = {
        repr(float(offset) + 80.0): each.with_columns(friction_n=each.column("friction_n") + 80.0)
        for offset, each in recordings.items()
    }
    model = fit_offset_model(shifted.values(), cylinder)
    error, _ = errors(model, shifted)
    assert np.sqrt(np.mean(error**2)) < 1.5
    for name, each in zip(shifted, model.sessions.values(), strict=True):
        assert abs(each.offset_n - float(name)) < 2.0 * each.standard_uncertainty_n


def test_a_session_alone_keeps_the_uncertainty_of_zero_or_asymmetry(cylinder: Cylinder) -> None:
    recording = sliding(cylinder, "s1", 10.0)
    model = fit_offset_model([recording], cylinder)
    (alone,) = model.sessions.values()
    assert alone.standard_uncertainty_n == pytest.approx(alone.prior_n, rel=0.1)
    rough = {name: SensorUncertainty(125e3, 0.0) for name in PRESSURES}
    unzeroed = sliding(cylinder, "s1", 400.0, uncertainty=rough)
    (alone,) = fit_offset_model([unzeroed], cylinder).sessions.values()
    assert abs(alone.offset_n - 400.0) < 2.0 * alone.standard_uncertainty_n < 0.4 * alone.prior_n


def test_a_corrected_label_is_free_of_the_offset_and_as_sure_as_it_was_identified(cylinder: Cylinder) -> None:
    *others, last = (
        each.with_columns(friction_uncertainty_n=np.full(len(each), 30.0)) for each in campaign(cylinder).values()
    )
    model = fit_offset_model(others, cylinder)
    found = model.identify([last])
    (corrected,) = model.corrected([last])
    assert model.corrected(others)[0].metadata.identified_zero
    np.testing.assert_allclose(last.column("friction_n") - corrected.column("friction_n"), found.offset_n)
    less_n = 4.0 * (found.prior_n**2 - found.standard_uncertainty_n**2)
    np.testing.assert_allclose(corrected.column("friction_uncertainty_n"), np.sqrt(30.0**2 - less_n))
    zeroed, areas = corrected.zeroed(), (cylinder.piston_area_m2, -cylinder.annulus_area_m2)
    taken_pa = (corrected.samples() - zeroed.samples())[0]
    assert corrected.samples().tolist() == last.samples().tolist(), "pressures stay as measured"
    assert taken_pa[:2] @ areas == pytest.approx(found.offset_n)
    assert taken_pa[0] / areas[0] == pytest.approx(taken_pa[1] / areas[1])
    assert zero_uncertainty_n(zeroed, cylinder) == pytest.approx(found.standard_uncertainty_n)
    assert zeroed.zeroed() is zeroed


def test_unmeasured_temperature_lets_a_session_depend_on_speed_in_its_own_way(cylinder: Cylinder) -> None:
    recordings = campaign(cylinder, oil_temperature_c=35.0)
    known = fit_offset_model(recordings.values(), cylinder)
    hidden = fit_offset_model(recordings.values(), cylinder, columns=("pressure_1_pa", "pressure_2_pa"))
    assert known.slope == 0.0 < hidden.slope
    assert "oil_temperature_c" not in hidden.quantities.inputs
    assert np.abs(errors(hidden, recordings)[0]).max() < 5.0


def test_what_cannot_be_identified_is_refused(cylinder: Cylinder) -> None:
    recording, other = sliding(cylinder, "s1", oil_temperature_c=35.0), sliding(cylinder, "s2")
    nothing = np.zeros(len(recording))
    model = fit_offset_model([recording], cylinder)
    for recordings, message in (
        (
            [replace(recording, metadata=replace(recording.metadata, uncertainty={}))],
            "of 'pressure_1_pa' is not stated",
        ),
        ([recording.with_columns(load_force_n=nothing)], "a load identified from position has absorbed the"),
        ([recording.with_columns(velocity_m_s=nothing)], "got no steady sliding in sessions s1; expected strokes"),
        ([], "sensor offsets cannot be identified: expected at least one recording"),
    ):
        with pytest.raises(RecordingError, match=message):
            fit_offset_model(recordings, cylinder)
    with pytest.raises(RecordingError, match=r"expected recordings of one session, but got 2 sessions \(s1, s2\)"):
        model.identify([recording, other])
    with pytest.raises(RecordingError, match="session 's2': column 'oil_temperature_c' is missing; the offset model"):
        model.identify([other])


@pytest.mark.parametrize("seed", range(4))
def test_noise_of_pressures_that_hardly_vary_is_no_asymmetry_that_absorbs_the_offsets(seed: int) -> None:
    generator = np.random.default_rng(seed)
    offsets_n, bars = 104.0 * generator.standard_normal(9), generator.uniform(12.0, 15.0, 9)
    sessions = [lifting(number, *both) for number, both in enumerate(zip(bars, offsets_n, strict=True))]
    found = offset_model(sessions, LIFT).about_mean().sessions
    error_n = np.array([found[each.session].offset_n for each in sessions]) - offsets_n + offsets_n.mean()
    assert np.std(error_n) < 0.1 * np.std(offsets_n)


ASYMMETRIES = {"1": 0.090, "2": 0.0535, "3": 0.0475, "4": 0.0225}


def by_condition(cylinder: Cylinder, asymmetries: dict[str, float]) -> dict[tuple[str, float], Recording]:
    """Return six sessions of each condition; keys are condition and exact offset."""
    offsets_n = 10.0 * np.random.default_rng(6).standard_normal(24)
    names = [name for name in asymmetries for _ in range(6)]
    return {
        (name, offset_n): sliding(
            cylinder, f"s{number:02d}", offset_n, asymmetry=2.0 * asymmetries[name], condition=name
        )
        for number, (name, offset_n) in enumerate(zip(names, offsets_n.tolist(), strict=True))
    }


@pytest.mark.parametrize("asymmetries", [ASYMMETRIES, dict.fromkeys(ASYMMETRIES, 0.05)], ids=["differ", "alike"])
def test_each_condition_may_have_an_asymmetry_of_its_own(asymmetries: dict[str, float], cylinder: Cylinder) -> None:
    recordings = by_condition(cylinder, asymmetries)
    train = [each for place, each in enumerate(recordings.values()) if place % 6 < 4]
    model = fit_offset_model(train, cylinder)
    found = model.offsets(recordings.values())
    off = {key: found[each.metadata.session].offset_n - key[1] for key, each in recordings.items()}
    mean_n = float(np.mean(list(off.values())))  # looks like the asymmetry that all conditions share
    for key, each in recordings.items():
        session = found[each.metadata.session]
        assert abs(off[key] - mean_n) <= 2.0 * session.relative_uncertainty_n
    differ = asymmetries is ASYMMETRIES
    assert (model.condition_sd > 0.03) == differ
    elsewhere = replace(train[0], metadata=replace(train[0].metadata, condition="5", session="new"))
    at_home = replace(train[0], metadata=replace(train[0].metadata, session="new"))
    new, home = (model.identify([each]).relative_uncertainty_n for each in (elsewhere, at_home))
    assert new > (2.0 if differ else 1.0) * home


def test_a_force_in_a_part_of_a_stroke_is_no_zero(cylinder: Cylinder) -> None:
    recordings = campaign(cylinder)
    pulled = {}
    for offset, each in recordings.items():
        near = each.column("position_m") > np.quantile(each.column("position_m"), 0.95)
        pulled[offset] = each.with_columns(friction_n=each.column("friction_n") + 3000.0 * near)
    error, _ = errors(fit_offset_model(pulled.values(), cylinder), pulled)
    assert np.sqrt(np.mean(error**2)) < 2.5
