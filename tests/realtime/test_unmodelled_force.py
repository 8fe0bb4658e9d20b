"""A force that an estimator does not know: the range that it learns, when the flag comes and goes, and what waits."""

from dataclasses import replace

import numpy as np
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.realtime.bounds import CREEP, SLIDING, regimes
from cylinder_friction.realtime.flags import Flag
from cylinder_friction.realtime.guard import TRAINED_MARGIN
from cylinder_friction.realtime.model import Guard, StepModel
from cylinder_friction.realtime.stream import RealTimeStream
from cylinder_friction.realtime.unmodelled_force import (
    LEAST_PRESSURE_SHARE,
    ZERO_DEVIATIONS,
    balance_weights,
    force_limits,
    with_force_limits,
)
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording, SensorUncertainty
from cylinder_friction.signals.causal import FirFilter
from learned_offset import learning

AWAY_N = 3000.0
STRETCHED = slice(1000, 1400)
"""Rows over which something pushes: 2 s."""


def pushed(recording: Recording, cylinder: Cylinder, rows: slice, force_n: float) -> np.ndarray:
    """Return samples of a recording with an external load over some rows."""
    samples = recording.samples().copy()
    samples[rows, 0] += force_n / cylinder.piston_area_m2
    return samples


def raised(model: StepModel, samples: np.ndarray) -> np.ndarray:
    return (RealTimeStream(model).run(samples)[1] & Flag.UNMODELLED_FORCE) != 0


def regimes_at(model: StepModel, samples: np.ndarray) -> np.ndarray:
    bounds, velocity_m_s = model.bounds, FirFilter(model.velocity_taps[None]).run(samples)[:, 0]
    return regimes(velocity_m_s, bounds.standstill_m_s, bounds.creep_m_s, bounds.reversal_samples)


def guard_of(hybrid: HybridEstimator, cylinder: Cylinder, recordings: list[Recording]) -> Guard:
    assert hybrid.guard is not None
    assert hybrid.bounds is not None
    return with_force_limits(hybrid.guard, hybrid.bounds, cylinder, recordings, hybrid.inputs)


def test_a_load_among_the_inputs_counts_against_the_balance(cylinder: Cylinder) -> None:
    weights = balance_weights(cylinder, ("load_force_n", *SAMPLE_COLUMNS, "oil_temperature_c"))
    assert weights == (-1.0, cylinder.piston_area_m2, -cylinder.annulus_area_m2, 0.0, 0.0)


def test_in_training_nothing_is_unmodelled_and_an_ordinary_offset_changes_nothing(
    small_model: StepModel, small_hybrid: HybridEstimator, cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    zero_pa = 3e4
    stated = {name: SensorUncertainty(zero_pa, 0.0) for name in SAMPLE_COLUMNS[:1]}
    measured = [replace(each, metadata=replace(each.metadata, uncertainty=stated)) for each in labelled_recordings]
    model = replace(small_model, guard=guard_of(small_hybrid, cylinder, measured))
    for recording in labelled_recordings:
        assert not raised(small_model, recording.samples()).any()
        for zeros in (-ZERO_DEVIATIONS, ZERO_DEVIATIONS):
            offset_n = zeros * zero_pa * cylinder.piston_area_m2
            assert not raised(model, pushed(recording, cylinder, slice(None), offset_n)).any()


def test_the_range_is_that_of_usable_rows_and_its_margin_is_as_stated(
    small_hybrid: HybridEstimator, cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    rows = np.arange(len(labelled_recordings[0]))
    measured = [
        each.with_columns(pressure_1_pa=np.where(rows == 700, 9e7, each.column("pressure_1_pa")), usable=rows != 700)
        for each in labelled_recordings
    ]
    assert guard_of(small_hybrid, cylinder, measured).largest_force == pytest.approx(
        guard_of(small_hybrid, cylinder, labelled_recordings).largest_force, rel=1e-3
    )
    constant, slope = guard_of(small_hybrid, cylinder, labelled_recordings).largest_force
    samples = np.concatenate([each.samples() for each in labelled_recordings])
    size_n = np.abs(samples @ np.array(balance_weights(cylinder, SAMPLE_COLUMNS)))
    above_n = constant + slope * samples[:, :2].sum(axis=1) - size_n
    assert above_n.min() == pytest.approx(TRAINED_MARGIN * size_n.max())


@pytest.mark.parametrize("force_n", [-AWAY_N, 600.0])
def test_a_load_is_flagged_from_its_first_sample_until_the_piston_has_moved_without_it(
    force_n: float, small_model: StepModel, cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    clear = 60
    model = replace(small_model, guard=replace(small_model.guard, clear_samples=clear))
    for recording in labelled_recordings[:3]:
        samples = pushed(recording, cylinder, STRETCHED, force_n)
        flagged = raised(model, samples)
        assert not flagged[: STRETCHED.start].any()
        assert flagged[STRETCHED].all() if abs(force_n) == AWAY_N else flagged[STRETCHED].any()
        last = np.flatnonzero(flagged)[-1]
        moves = np.isin(regimes_at(model, samples), (CREEP, SLIDING))
        assert clear <= moves[STRETCHED.stop : last + 1].sum() < 1.2 * clear
        assert flagged[STRETCHED.stop : last].all()


def test_a_small_force_along_the_motion_is_no_friction(
    small_model: StepModel, cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    recording = labelled_recordings[1]
    samples = recording.samples()
    row = int(np.flatnonzero(regimes_at(small_model, samples) == SLIDING)[50])
    balance_n = float(samples[row] @ force_limits(small_model)[0, :3])
    stood = pushed(recording, cylinder, slice(row, row + 1), -1.5 * balance_n)
    assert raised(small_model, stood)[row]
    assert abs(0.5 * balance_n) < small_model.guard.largest_force[0]


@pytest.mark.parametrize("per_pa", [0.0, 1e-5, 1e-3])
def test_pressures_in_another_unit_are_flagged_in_every_row_even_at_rest(
    per_pa: float, small_model: StepModel, labelled_recordings: list[Recording]
) -> None:
    sums = np.concatenate([each.samples()[each.usable(), :2].sum(axis=1) for each in labelled_recordings])
    assert small_model.guard.least_pressure_pa == pytest.approx(LEAST_PRESSURE_SHARE * sums.min())
    samples = labelled_recordings[0].samples() * [per_pa, per_pa, 1.0]
    assert raised(small_model, samples).all()
    assert raised(small_model, np.tile(samples[0], (1000, 1))).all()


def test_a_load_is_not_learned_as_an_offset(
    small_model: StepModel, cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    model = replace(learning(small_model), guard=small_model.guard)
    careless = replace(model, guard=replace(model.guard, force_weights=()))
    samples = pushed(labelled_recordings[0], cylinder, slice(None), 450.0)
    offsets_n = {}
    for name, each in (("careful", model), ("careless", careless)):
        stream = RealTimeStream(each)
        stream.run(samples)
        offsets_n[name] = stream.offset[0]
    assert raised(model, samples)[-1000:].all()
    assert abs(offsets_n["careful"]) < 0.5 * abs(offsets_n["careless"])


def test_what_cannot_know_a_range_never_raises_it(
    designed: FrictionEstimator, small_hybrid: HybridEstimator, cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    model = designed.step_model()
    knows = designed.kind == "hybrid" and set(SAMPLE_COLUMNS) <= set(designed.inputs)
    assert bool(model.guard.force_weights) == knows, "hybrids calibrate themselves"
    assert force_limits(small_hybrid.without_forest().step_model()).size == 0, "no bounds, so no regimes of motion"
    assert guard_of(small_hybrid, cylinder, []) == small_hybrid.guard
