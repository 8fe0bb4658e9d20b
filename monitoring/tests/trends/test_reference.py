"""The expected value of an indicator follows physics."""

import numpy as np
import pytest

from cylinder_friction.recordings.columns import OIL_TEMPERATURE
from cylinder_friction_monitoring.arrays import Array
from cylinder_friction_monitoring.trends.reference import VISCOSITY_1_K, fitted

BASELINE, LEVEL = 90, 2e-13


def covariates(oil_c: Array) -> dict[str, Array]:
    return {OIL_TEMPERATURE: oil_c} | dict.fromkeys(
        ("pressure_bar", "speed_m_s", "load_n"), np.full(len(oil_c), np.nan)
    )


@pytest.mark.parametrize(("indicator", "power"), [("leak_m3_s_pa", -1.0), ("viscous_n_s_m", 1.0)])
def test_leak_rises_and_viscous_friction_falls_as_the_oil_thins(indicator: str, power: float) -> None:
    def values(oil_c: Array) -> Array:
        return np.asarray(LEVEL * np.exp(-power * VISCOSITY_1_K * (oil_c - 40.0)))

    generator = np.random.default_rng(3)
    warm_c, cold_c = generator.uniform(34.0, 46.0, BASELINE), np.array([25.0])
    measured = values(warm_c) * (1.0 + 0.02 * generator.standard_normal(BASELINE))
    reference = fitted(indicator, measured, np.full(BASELINE, 0.02 * LEVEL), covariates(warm_c), LEVEL)
    expected = reference.design(covariates(cold_c)) @ reference.coefficients
    assert expected == pytest.approx(values(cold_c), rel=0.05)
