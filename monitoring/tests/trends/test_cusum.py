"""The test of an indicator: laws that hold, the stated rate of false alarms, and a reference that follows physics."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylinder_friction.recordings.columns import OIL_TEMPERATURE
from cylinder_friction_monitoring.trends.cusum import GREATEST, cusum, threshold
from cylinder_friction_monitoring.trends.plan import MonitorPlan
from cylinder_friction_monitoring.trends.reference import VISCOSITY_1_K, Reference, fitted

PLAN = MonitorPlan()


def made(seed: int, count: int = 200) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    generator = np.random.default_rng(seed)
    oil_c = 40.0 + generator.normal(0.0, 3.0, count)
    covariates = {
        "oil_temperature_c": oil_c,
        "pressure_bar": 30.0 + generator.normal(0.0, 1.0, count),
        "speed_m_s": 0.03 + generator.normal(0.0, 0.001, count),
        "load_n": np.full(count, np.nan),
    }
    return 400.0 - 1.5 * (oil_c - 40.0) + generator.normal(0.0, 8.0, count), covariates


def statistics(values: np.ndarray, covariates: dict[str, np.ndarray]) -> tuple[Reference, np.ndarray, np.ndarray]:
    unknown = np.zeros(len(values))
    first = {name: each[:90] for name, each in covariates.items()}
    reference = fitted("friction_n", values[:90], unknown[:90], first, float(np.median(values[:90])), PLAN)
    design = reference.design(covariates)
    found = cusum(reference, values - design @ reference.coefficients, unknown, design, 90, PLAN.widest)
    return reference, found.upward, found.downward


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 1000), st.floats(0.01, 100.0))
def test_the_unit_does_not_matter_and_the_sign_turns_up_into_down(seed: int, scale: float) -> None:
    values, covariates = made(seed)
    _, upward, downward = statistics(values, covariates)
    for factor, expected in ((scale, (upward, downward)), (-1.0, (downward, upward))):
        _, *found = statistics(factor * values, covariates)
        np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6)


def test_oil_is_taken_out() -> None:
    values, covariates = made(3)
    reference, _, _ = statistics(values, covariates)
    assert reference.scatter == pytest.approx(8.0, rel=0.2)
    per_kelvin = reference.coefficients[1] * reference.scale[1]
    assert per_kelvin == pytest.approx(1.5, abs=0.6)  # per kelvin of cooling


def test_a_rise_shows_upward_after_the_baseline_and_no_session_counts_for_more_than_the_greatest() -> None:
    values, covariates = made(6)
    values[90:] += 30.0
    values[100] *= 50.0
    _, upward, downward = statistics(values, covariates)
    assert np.isnan(upward[:90]).all()
    assert np.nanmax(upward) > 5.0 > np.nanmax(downward[:100])
    assert upward[100] - upward[99] < GREATEST


def test_shorter_or_less_sure_baselines_and_rarer_alarms_need_more() -> None:
    assert threshold(90, 0.3, 0.002, 365.0) > threshold(90, 0.3, 0.02, 365.0)
    assert threshold(90, 0.3, 0.002, 3650.0) > threshold(90, 0.3, 0.002, 365.0)
    assert threshold(60, 0.3, 1.0, 12.0) > 0.0
    assert threshold(1000, 0.3, 0.002, 365.0) == threshold(250, 0.3, 0.002, 365.0)


SESSIONS, LEVEL = 90, 2e-13


@pytest.mark.parametrize(("indicator", "power"), [("leak_m3_s_pa", -1.0), ("viscous_n_s_m", 1.0)])
def test_leak_rises_and_viscous_friction_falls_as_the_oil_thins(indicator: str, power: float) -> None:
    generator = np.random.default_rng(3)

    def covariates(oil_c: np.ndarray) -> dict[str, np.ndarray]:
        unknown = np.full(len(oil_c), np.nan)
        return {OIL_TEMPERATURE: oil_c, "pressure_bar": unknown, "speed_m_s": unknown, "load_n": unknown}

    def values(oil_c: np.ndarray) -> np.ndarray:
        return LEVEL * np.exp(-power * VISCOSITY_1_K * (oil_c - 40.0))

    warm_c, cold_c = generator.uniform(34.0, 46.0, SESSIONS), np.array([25.0])
    measured = values(warm_c) * (1.0 + 0.02 * generator.standard_normal(SESSIONS))
    plan = MonitorPlan()
    reference = fitted(indicator, measured, np.full(SESSIONS, 0.02 * LEVEL), covariates(warm_c), LEVEL, plan)
    expected = reference.design(covariates(cold_c)) @ reference.coefficients
    assert expected == pytest.approx(values(cold_c), rel=0.05)
