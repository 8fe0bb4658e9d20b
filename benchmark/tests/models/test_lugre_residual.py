"""LuGre with a learned residual: what is corrected, and what sliding friction may not do."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from friction_benchmark.models.gradient_boosting import BoostingPlan
from friction_benchmark.models.lugre_residual import LugreFeatureBlock, LugreResidualEstimator

if TYPE_CHECKING:
    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.recordings.recording import Recording

PLAN = BoostingPlan(trees=40, leaves=8, rows=4000)
BLIND = ("position_m",)


def made(cylinder: Cylinder, inputs: tuple[str, ...], passive_above_m_s: float = 0.0) -> LugreResidualEstimator:
    return LugreResidualEstimator(
        cylinder,
        inputs,
        PLAN,
        passive_above_m_s=passive_above_m_s,
        identification_effort=0.02,
        identified_on=4,
    )


@pytest.fixture(scope="module")
def blind(cylinder: Cylinder, labelled_recordings: list[Recording]) -> LugreResidualEstimator:
    estimator = made(cylinder, BLIND)
    estimator.fit(labelled_recordings)
    return estimator


def mae_n(estimate: np.ndarray, recording: Recording) -> float:
    return float(np.abs(estimate - recording.column("friction_n")).mean())


def test_without_pressures_lugre_is_what_is_corrected(
    blind: LugreResidualEstimator, labelled_recordings: list[Recording]
) -> None:
    assert not blind.lugre.model.pressure_scaled
    block = blind._block
    assert isinstance(block, LugreFeatureBlock)
    samples = labelled_recordings[0].samples(BLIND)
    features, base_n = block.advance(block.new_state(), samples)
    lugre_n = blind.lugre.estimate(labelled_recordings[0])
    np.testing.assert_array_equal(base_n, lugre_n)
    np.testing.assert_allclose(features[:, -1], lugre_n / blind.lugre_scale_n, rtol=1e-6)


def test_trees_leave_less_than_lugre(blind: LugreResidualEstimator, labelled_recordings: list[Recording]) -> None:
    whole = np.mean([mae_n(blind.estimate(recording), recording) for recording in labelled_recordings])
    alone = np.mean([mae_n(blind.lugre.estimate(recording), recording) for recording in labelled_recordings])
    assert whole < 0.8 * alone


def test_with_raw_pressures_the_force_balance_stays_the_base(
    cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    estimator = made(cylinder, ("pressure_1_pa", "pressure_2_pa", "position_m"))
    estimator.fit(labelled_recordings)
    assert estimator.lugre.model.pressure_scaled
    block = estimator._block
    assert block is not None
    samples = labelled_recordings[0].samples()
    features, base_n = block.advance(block.new_state(), samples)
    force_n = samples[:, 0] * cylinder.piston_area_m2 - samples[:, 1] * cylinder.annulus_area_m2
    assert np.abs(base_n - force_n).mean() < 25.0
    together = (features[:, -2] + features[:, -1]) * estimator.lugre_scale_n
    np.testing.assert_allclose(together, base_n, rtol=1e-4, atol=0.1)


def test_sliding_friction_never_feeds_energy_above_the_chosen_speed(
    cylinder: Cylinder, blind: LugreResidualEstimator, labelled_recordings: list[Recording]
) -> None:
    passive = made(cylinder, BLIND, passive_above_m_s=0.01)
    turned = [recording.with_columns(friction_n=-recording.column("friction_n")) for recording in labelled_recordings]
    passive.fit(turned)  # a label that always feeds energy
    recording = labelled_recordings[0]
    estimate, velocity = passive.estimate(recording), recording.column("velocity_m_s")
    fast = np.abs(velocity) > 0.015
    assert fast.mean() > 0.5
    assert (estimate[fast] * velocity[fast] >= -1.0).all()
    free = made(cylinder, BLIND)
    free.fit(turned)
    assert (free.estimate(recording)[fast] * velocity[fast] < -1.0).any()


def test_a_negative_speed_is_refused(cylinder: Cylinder) -> None:
    with pytest.raises(ValueError, match=r"passive_above_m_s must be 0 or a positive number, but got -0\.1"):
        LugreResidualEstimator(cylinder, passive_above_m_s=-0.1)
