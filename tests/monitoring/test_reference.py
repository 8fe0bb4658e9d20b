"""The reference of an indicator follows physics outside what the baseline holds."""

from __future__ import annotations

import numpy as np
import pytest

from cylinder_friction.monitoring.plan import MonitorPlan
from cylinder_friction.monitoring.reference import VISCOSITY_1_K, fitted
from cylinder_friction.recordings.columns import OIL_TEMPERATURE

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
