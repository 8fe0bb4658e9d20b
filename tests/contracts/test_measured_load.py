"""A measured load in the force balance: every runtime learns the offset of the three sensors together."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from contracts.runtimes import Runtime, all_runtimes, run
from contracts.tolerances import TOLERANCES_N
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.training_plan import Architecture, TrainingPlan
from cylinder_friction.realtime.flags import Flag
from cylinder_friction.recordings.columns import LOAD_FORCE, SAMPLE_COLUMNS
from cylinder_friction.testing.golden import Trajectory, trace
from learned_offset import SPREAD_N, made_tracker

if TYPE_CHECKING:
    from pathlib import Path

    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.realtime.model import StepModel
    from cylinder_friction.recordings.recording import Recording

COLUMNS = (*SAMPLE_COLUMNS, LOAD_FORCE)


@pytest.fixture(scope="module")
def loaded(cylinder: Cylinder, labelled_recordings: list[Recording]) -> list[Recording]:
    """Recordings whose piston side carries a load of up to 800 N besides."""
    result = []
    for recording in labelled_recordings[:4]:
        load_n = 800.0 * np.sin(1.3 * recording.column("time_s"))
        pressure_pa = recording.column("pressure_1_pa") + load_n / cylinder.piston_area_m2
        result.append(recording.with_columns(load_force_n=load_n, pressure_1_pa=pressure_pa))
    return result


@pytest.fixture(scope="module")
def model(cylinder: Cylinder, loaded: list[Recording]) -> StepModel:
    architecture, plan = Architecture(1, 8, 0.0, 1e-3), TrainingPlan(2, 2, 200, 20, 4)
    hybrid = HybridEstimator(cylinder, "force_balance", architecture, plan, None, inputs=COLUMNS)
    found = hybrid.fit(loaded).step_model()
    return replace(found, offset=made_tracker((-1.01,)), bounds=replace(found.bounds, spread_n=SPREAD_N))


@pytest.fixture(scope="module")
def expected(model: StepModel, loaded: list[Recording]) -> Trajectory:
    """What the reference gives where the load cell reads 60 N too little, and at times nothing."""
    samples = np.concatenate([recording.samples(COLUMNS) for recording in loaded])[:6000]
    samples[:, 3] -= 60.0
    samples[3000:3010, 3], samples[4000, 3] = np.nan, 1e6
    return trace(model, samples)


@pytest.mark.parametrize("runtime", all_runtimes(), ids=lambda runtime: runtime.name)
def test_it_learns_the_offset_that_a_load_cell_is_part_of(
    runtime: Runtime, model: StepModel, expected: Trajectory, tmp_path: Path
) -> None:
    newtons, flags = run(runtime.open(model, tmp_path), expected.samples)
    np.testing.assert_array_equal(flags, expected.flags)
    np.testing.assert_allclose(newtons, expected.newtons, rtol=0.0, atol=TOLERANCES_N[runtime.name])


def test_the_reference_learns_it(model: StepModel, expected: Trajectory) -> None:
    """Estimates move by most of the 60 N, and a load that is none is flagged and held."""
    blind = trace(replace(model, offset=None), expected.samples)
    learned_n = (blind.newtons - expected.newtons)[:, 0]
    assert learned_n[0] == 0.0
    assert learned_n[-500:].mean() == pytest.approx(60.0, abs=25.0)
    invalid = (expected.flags & Flag.INVALID_OTHER) != 0
    assert np.flatnonzero(invalid).tolist() == [*range(3000, 3010), 4000]
    assert np.isfinite(expected.newtons).all()
