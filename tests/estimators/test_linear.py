"""Force balance, low-pass and ridge against what can be worked out by hand."""

import ast
import re
from collections.abc import Callable, Sequence

import numpy as np
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.linear import ForceBalanceEstimator, LowPassForceBalanceEstimator, RidgeEstimator
from cylinder_friction.estimators.lugre import LugreEstimator
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording, RecordingError


def error_n(estimator: FrictionEstimator, recordings: list[Recording]) -> float:
    errors = [np.abs(estimator.estimate(r) - r.column("friction_n")) for r in recordings]
    return float(np.mean(np.concatenate(errors)))


def test_unfiltered_force_balance_is_pressures_times_areas(
    cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    estimator = ForceBalanceEstimator(cylinder, "none").fit(labelled_recordings)
    samples = labelled_recordings[0].samples()
    expected = samples[:, 0] * cylinder.piston_area_m2 - samples[:, 1] * cylinder.annulus_area_m2
    np.testing.assert_allclose(estimator.estimate(labelled_recordings[0]), expected, rtol=1e-12)


def test_paper_force_balance_takes_inertia_off(cylinder: Cylinder, labelled_recordings: list[Recording]) -> None:
    estimator = ForceBalanceEstimator(cylinder, "paper").fit(labelled_recordings)
    time_s = 0.005 * np.arange(400)
    acceleration_m_s2 = 3.0
    stream = estimator.stream()
    for t in time_s:
        force_n = stream.step(2e5, 1e5, 0.5 * acceleration_m_s2 * t**2)
    balance_n = 2e5 * cylinder.piston_area_m2 - 1e5 * cylinder.annulus_area_m2
    assert force_n == pytest.approx(balance_n - cylinder.moving_mass_kg * acceleration_m_s2, rel=1e-6)


def test_paper_filters_delay_a_pressure_ramp_by_half_their_window(
    cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    stream = ForceBalanceEstimator(cylinder, "paper").fit(labelled_recordings).stream()
    rate_pa_s = 1e6
    for step in range(100):
        force_n = stream.step(rate_pa_s * 0.005 * step, 0.0, 0.1)
    lag_s = 0.005 * 99 - force_n / (cylinder.piston_area_m2 * rate_pa_s)
    assert lag_s == pytest.approx(4.5 * 0.005)


def test_the_low_pass_is_tuned_to_beat_no_filter(cylinder: Cylinder, labelled_recordings: list[Recording]) -> None:
    raw = ForceBalanceEstimator(cylinder, "none").fit(labelled_recordings)
    tuned = LowPassForceBalanceEstimator(cylinder).fit(labelled_recordings)
    assert tuned.weight is not None
    assert 0.05 < tuned.weight < 0.95
    assert error_n(tuned, labelled_recordings) < 0.9 * error_n(raw, labelled_recordings)
    for other in (0.5 * tuned.weight, min(1.0, 1.5 * tuned.weight)):
        beside = LowPassForceBalanceEstimator(cylinder, other)
        beside._begin_fit(labelled_recordings)
        assert error_n(tuned, labelled_recordings) <= error_n(beside, labelled_recordings)


@pytest.mark.parametrize(
    "unaware",
    [
        lambda inputs, _: RidgeEstimator(lags=1, penalty=1e-6, inputs=inputs),
        lambda inputs, cylinder: ForceBalanceEstimator(cylinder, inputs=inputs),
        lambda inputs, cylinder: HybridEstimator(cylinder, inputs=inputs),
    ],
    ids=["ridge", "force balance", "hybrid"],
)
def test_labels_without_a_load_are_not_learned_from_pressures_with_it(
    unaware: Callable[[Sequence[str], Cylinder], FrictionEstimator],
    cylinder: Cylinder,
    labelled_recordings: list[Recording],
) -> None:
    """The refusal gives the argument with which ``fit`` finds friction, however large the load is."""
    loaded = []
    for number, recording in enumerate(labelled_recordings):
        load_n = (4000.0 + 500.0 * number) * np.ones(len(recording))
        pressure_pa = recording.column("pressure_1_pa") + load_n / cylinder.piston_area_m2
        loaded.append(recording.with_columns(pressure_1_pa=pressure_pa, load_force_n=load_n))
    with pytest.raises(RecordingError, match=r"subtracted a load .* if position decides it, set position_load") as why:
        unaware(SAMPLE_COLUMNS, cylinder).fit(loaded)
    inputs = ast.literal_eval(re.search(r"give inputs=(\(.*?\)) if", str(why.value))[1])
    knowing = unaware(inputs, cylinder)
    if isinstance(knowing, HybridEstimator):  # it trains for minutes
        assert knowing._begin_fit(loaded)
        return
    unloaded = unaware(SAMPLE_COLUMNS, cylinder).fit(labelled_recordings)
    off_n = [error_n(each, rows) for each, rows in ((knowing.fit(loaded), loaded), (unloaded, labelled_recordings))]
    assert off_n[0] == pytest.approx(off_n[1], rel=0.05)


def test_what_reads_no_force_needs_no_load(cylinder: Cylinder, labelled_recordings: list[Recording]) -> None:
    loaded = [each.with_columns(load_force_n=np.full(len(each), 900.0)) for each in labelled_recordings[:2]]
    LugreEstimator(cylinder)._begin_fit(loaded)
    HybridEstimator(cylinder, inputs=("position_m",))._begin_fit(loaded)


@pytest.mark.parametrize("delay", [0, 2])
def test_ridge_finds_the_areas_when_the_label_is_linear_in_a_sample(
    cylinder: Cylinder, labelled_recordings: list[Recording], delay: int
) -> None:
    areas_m2, linear = [cylinder.piston_area_m2, -cylinder.annulus_area_m2, 0.0], []
    for recording in labelled_recordings:
        samples = recording.samples()
        late = samples[np.maximum(np.arange(len(samples)) - delay, 0)]
        linear.append(recording.with_columns(friction_n=late @ areas_m2))
    estimator = RidgeEstimator(lags=1 + delay, penalty=1e-6).fit(linear)
    assert error_n(estimator, linear) < 1e-3


def test_the_order_of_the_inputs_does_not_matter_to_the_force_balance(
    cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    turned = ("position_m", "pressure_2_pa", "pressure_1_pa")
    one, other = (
        LowPassForceBalanceEstimator(cylinder, inputs=inputs).fit(labelled_recordings[:2])
        for inputs in (SAMPLE_COLUMNS, turned)
    )
    recording = labelled_recordings[0]
    np.testing.assert_allclose(other.estimate(recording), one.estimate(recording), rtol=1e-12)


def test_what_makes_no_estimator_is_refused(cylinder: Cylinder) -> None:
    with pytest.raises(ValueError, match="lags must be at least 1 sample, but got 0"):
        RidgeEstimator(lags=0)
    with pytest.raises(ValueError, match="filtering must be 'none' or 'paper', but got 'kalman'"):
        ForceBalanceEstimator(cylinder, "kalman")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="expected pressure_1_pa, pressure_2_pa, position_m among the inputs, but got"):
        ForceBalanceEstimator(cylinder, "none", ("position_m",))
