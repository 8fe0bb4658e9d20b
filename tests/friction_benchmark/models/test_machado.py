"""The network of Machado: what it sees of the pressures, and what its plan refuses."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from friction_benchmark.models.machado import MachadoEstimator, MachadoPlan

if TYPE_CHECKING:
    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.recordings.recording import Recording


def test_machado_without_the_force_balance_knows_pressures_at_standstill_alone(
    cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    estimator = MachadoEstimator(cylinder, plan=MachadoPlan(iterations=40, corrects="nothing"))
    estimator.fit(labelled_recordings)
    recording = labelled_recordings[0]
    samples = recording.samples()
    louder = samples.copy()
    louder[:, 0] += 2e5
    difference = estimator.advance(estimator.new_state(), louder) - estimator.advance(estimator.new_state(), samples)
    fast = np.abs(recording.column("velocity_m_s")) > 0.02
    assert np.abs(difference[fast]).max() == 0.0
    assert np.abs(difference).max() > 0.0


def test_an_impossible_plan_is_refused() -> None:
    with pytest.raises(ValueError, match="expected nodes, delay and iterations of at least 1"):
        MachadoPlan(nodes=0)
