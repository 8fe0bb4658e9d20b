"""A load in the force balance, measured or decided by positions: every runtime knows it and learns offsets beside."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from contracts.runtimes import Runtime, all_runtimes, run
from contracts.tolerances import TOLERANCES_N
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.deployment.scoring import ScoringError, ServedModel
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.training_plan import Architecture, TrainingPlan
from cylinder_friction.realtime.flags import Flag
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.realtime.position_load import LoadAxis, PositionLoad
from cylinder_friction.recordings.columns import LOAD_FORCE, OTHER_POSITIONS, PRESSURE_1, SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording, SensorUncertainty
from cylinder_friction.testing.golden import Trajectory, trace
from learned_offset import SPREAD_N, made_tracker
from served_rows import score

PLACES = np.linspace(0.02, 0.23, 40)
LOAD = PositionLoad(0.02, 0.23, 800.0 * np.sin(30.0 * PLACES), np.full(40, 5.0))
ACROSS = np.linspace(0.4, 0.6, 9)
OF_TWO = PositionLoad(
    0.02,
    0.23,
    800.0 * np.sin(30.0 * PLACES)[:, None] * (ACROSS - 0.2) / 0.4,
    np.full((40, 9), 5.0),
    (LoadAxis(OTHER_POSITIONS[0], 0.4, 0.6),),
    np.add.outer(np.arange(40), 4 * np.arange(9)) < 40,
)
KINDS = {"measured": None, "position": LOAD, "two positions": OF_TWO}


@dataclass(frozen=True)
class Case:
    """A step model that knows the load, with what Python gives where sensors are off by 60 N together."""

    model: StepModel
    expected: Trajectory


@pytest.fixture(scope="module", params=KINDS.values(), ids=KINDS)
def case(request: pytest.FixtureRequest, cylinder: Cylinder, labelled_recordings: list[Recording]) -> Case:
    """Recordings whose piston side carries a load of up to 800 N besides; at times a sensor gives nothing."""
    position_load: PositionLoad | None = request.param
    loaded, stated = [], {PRESSURE_1: SensorUncertainty(60.0 / cylinder.piston_area_m2, 0.0)}
    for recording in labelled_recordings[:4]:
        other_m = 0.5 + 0.11 * np.sin(0.7 * recording.column("time_s"))
        recording = recording.with_columns(**{OTHER_POSITIONS[0]: other_m})
        load_n = 800.0 * np.sin(1.3 * recording.column("time_s"))
        if position_load is not None:
            load_n = position_load.of(recording)
        pressure_pa = recording.column("pressure_1_pa") + load_n / cylinder.piston_area_m2
        carrying = recording.with_columns(load_force_n=load_n, pressure_1_pa=pressure_pa)
        loaded.append(replace(carrying, metadata=replace(recording.metadata, uncertainty=stated)))
    inputs = (*SAMPLE_COLUMNS, *([LOAD_FORCE] if position_load is None else position_load.columns[1:]))
    hybrid = HybridEstimator(
        cylinder,
        "force_balance",
        Architecture(1, 8, 0.0, 1e-3),
        TrainingPlan(2, 2, 200, 20, 4),
        None,
        inputs=inputs,
        position_load=position_load,
    )
    found = hybrid.fit(loaded).step_model()
    tracker = made_tracker((*[0.0] * (len(found.channels) - 4), -1.01))
    model = replace(found, offset=tracker, bounds=replace(found.bounds, spread_n=SPREAD_N))
    samples = np.concatenate([recording.samples(inputs) for recording in loaded])[:6000]
    samples[:, 0] += 60.0 / cylinder.piston_area_m2
    samples[3000:3010, -1], samples[4000, -1] = np.nan, 1e6
    return Case(model, trace(model, samples))


@pytest.mark.parametrize("runtime", all_runtimes(), ids=lambda runtime: runtime.name)
def test_it_takes_the_load_off_and_learns_the_sensors_offset(runtime: Runtime, case: Case, tmp_path: Path) -> None:
    newtons, flags = run(runtime.open(case.model, tmp_path), case.expected.samples)
    np.testing.assert_array_equal(flags, case.expected.flags)
    np.testing.assert_allclose(newtons, case.expected.newtons, rtol=0.0, atol=TOLERANCES_N[runtime.name])


def test_the_served_model_takes_the_load_off_too(case: Case) -> None:
    samples = case.expected.samples[:2500]
    rows = pd.DataFrame(samples, columns=list(case.model.inputs))
    served = ServedModel(case.model)
    scored = score(served, rows)
    np.testing.assert_array_equal(scored["flags"], case.expected.flags[:2500])
    newtons = scored[["friction_n", "lower_n", "upper_n"]]
    np.testing.assert_array_equal(newtons, case.expected.newtons[:2500])
    if LOAD_FORCE in case.model.inputs:
        with pytest.raises(ScoringError, match="column 'load_force_n' is missing"):
            score(served, rows.drop(columns=LOAD_FORCE))
    else:
        with pytest.raises(ScoringError, match=r"this model knows: a load of .* which position decides"):
            score(served, rows.assign(load_force_n=100.0))


def test_python_learns_it(case: Case) -> None:
    """Estimates move by most of the 60 N, and what is none is flagged and held."""
    blind = trace(replace(case.model, offset=None), case.expected.samples)
    learned_n = (blind.newtons - case.expected.newtons)[:, 0]
    assert learned_n[0] == 0.0
    assert learned_n[-500:].mean() == pytest.approx(60.0, abs=35.0)
    invalid = (case.expected.flags & (Flag.INVALID_OTHER | Flag.INVALID_POSITION)) != 0
    assert np.flatnonzero(invalid).tolist() == [*range(3000, 3010), 4000]
    assert np.isfinite(case.expected.newtons).all()


def test_where_the_load_is_not_known_is_outside(case: Case) -> None:
    load = case.model.position_load
    if load is None or load.known is None:
        return
    samples, trained = case.expected.samples, np.array(case.model.guard.trained_upper)
    within = np.all((samples >= case.model.guard.trained_lower) & (samples <= trained), axis=1)
    places = [case.model.inputs.index(name) for name in load.columns]
    along, across = (samples[:, place] for place in places)
    known = 39 * (along - 0.02) / 0.21 + 4 * 8 * (across - 0.4) / 0.2 < 35.0
    unknown = 39 * (along - 0.02) / 0.21 + 4 * 8 * (across - 0.4) / 0.2 > 45.0
    outside = case.expected.flags & Flag.OUTSIDE != 0
    assert outside[within & unknown].all()
    assert not outside[within & known].any()
    assert (within & unknown).sum() > 100
