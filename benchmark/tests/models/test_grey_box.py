"""Models that learn beside an equation: NARX, LuGre with a learned residual, and the filter of learned gain."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import torch

from cylinder_friction.estimators.linear import LowPassForceBalanceEstimator
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from friction_benchmark.models.learned_gain import LearnedGain, track
from friction_benchmark.models.lugre_residual import LugreResidual
from friction_benchmark.models.narx import CLIP, Narx, candidate_terms, chosen_terms, filtered_terms
from friction_benchmark.models.stroke_memory import MEMORY_NAMES, remember_strokes
from friction_benchmark.registry import BuildConfiguration, registered_models

if TYPE_CHECKING:
    from collections.abc import Sequence

    from cylinder_friction.arrays import Array
    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.recordings.recording import Recording

BLIND = ("position_m",)


def build(
    name: str, cylinder: Cylinder, effort: float, inputs: tuple[str, ...] = SAMPLE_COLUMNS, **chosen: Any
) -> BuildConfiguration:
    return BuildConfiguration(cylinder, inputs, 0, effort, {**registered_models()[name].defaults, **chosen})


def test_candidates_are_constant_linear_and_second_degree() -> None:
    terms = candidate_terms(present=2, columns=3)
    assert {tuple(term) for term in terms} == {(0, 0), (1, 0), (2, 0), (3, 0), (1, 1), (2, 1), (2, 2)}


def test_forward_regression_takes_the_true_terms_first_and_collinear_ones_once() -> None:
    generator = np.random.default_rng(0)
    columns = np.column_stack([np.ones(4000), generator.normal(size=(4000, 5))])
    terms = candidate_terms(5, 5)
    regressors = filtered_terms(columns, terms, np.zeros(4000), 1)
    true = [int(np.flatnonzero((terms == pair).all(axis=1))[0]) for pair in ((3, 0), (4, 2))]
    target = 3.0 * regressors[:, true[0]] - 2.0 * regressors[:, true[1]] + generator.normal(0.0, 0.1, 4000)
    found = chosen_terms(regressors.T @ regressors, regressors.T @ target, 4)
    assert set(found[:2]) == set(true)
    column = generator.normal(size=500)
    same = np.column_stack([column, column, 2.0 * column])
    assert len(chosen_terms(same.T @ same, same.T @ column, 3)) == 1


def test_filtered_terms_keep_a_share_of_the_last_row() -> None:
    columns = np.array([[1.0, 4.0], [1.0, 0.0], [1.0, 0.0], [1.0, 8.0]])
    kept = np.array([0.9, 0.5, 0.5, 0.0])
    found = filtered_terms(columns, np.array([[1, 0]]), kept, 1)[:, 0]
    assert found.tolist() == [4.0, 2.0, 1.0, 8.0]
    assert filtered_terms(columns, np.array([[1, 0]]), kept, 2)[:, 0].tolist() == [2.0, 8.0]


def test_narx_runs_on_its_own_output_and_stays_bounded(
    cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    narx = Narx(build("narx", cylinder, 0.02, terms=20)).fit(labelled_recordings)
    narx.at_rest, narx.sliding = 0.5, 0.98
    features, _ = narx.features_of(labelled_recordings[0])
    columns, kept = narx._columns(features), narx._kept(features)
    assert kept.min() >= 0.0
    assert kept.max() <= 0.98
    run = filtered_terms(columns, narx._terms, kept, 1) @ narx._weights  # linear in the weights behind its own poles
    np.testing.assert_allclose(narx.predict(features), run, rtol=1e-6, atol=1e-6)
    wild = 1e3 * np.random.default_rng(0).normal(size=features.shape).astype(np.float32)
    assert np.abs(narx.predict(wild)).max() <= np.abs(narx._weights).sum() * CLIP**2 * 1.01


@pytest.fixture(scope="module")
def blind(cylinder: Cylinder, labelled_recordings: list[Recording]) -> LugreResidual:
    return LugreResidual(build("lugre_residual", cylinder, 0.05, BLIND)).fit(labelled_recordings)


def test_without_pressures_trees_correct_lugre(blind: LugreResidual, labelled_recordings: list[Recording]) -> None:
    assert not blind.lugre.model.pressure_scaled
    features, base_n = blind.features_of(labelled_recordings[0])
    lugre_n = blind.lugre.estimate(labelled_recordings[0])
    np.testing.assert_array_equal(base_n, lugre_n)
    np.testing.assert_allclose(features[:, -1], lugre_n / blind.lugre_scale_n, rtol=1e-6)
    errors = [
        np.mean([np.abs(model.estimate(each) - each.column("friction_n")).mean() for each in labelled_recordings])
        for model in (blind, blind.lugre)
    ]
    assert errors[0] < 0.8 * errors[1]


def test_with_raw_pressures_the_force_balance_stays_the_base(
    cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    model = LugreResidual(build("lugre_residual", cylinder, 0.02)).fit(labelled_recordings)
    assert model.lugre.model.pressure_scaled
    samples = labelled_recordings[0].samples()
    features, base_n = model.features_of(labelled_recordings[0])
    force_n = samples[:, 0] * cylinder.piston_area_m2 - samples[:, 1] * cylinder.annulus_area_m2
    assert np.abs(base_n - force_n).mean() < 25.0
    together = (features[:, -2] + features[:, -1]) * model.lugre_scale_n
    np.testing.assert_allclose(together, base_n, rtol=1e-4, atol=0.1)


def test_sliding_friction_never_feeds_energy_above_the_chosen_speed(
    cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    turned = [recording.with_columns(friction_n=-recording.column("friction_n")) for recording in labelled_recordings]
    recording = labelled_recordings[0]
    velocity = recording.column("velocity_m_s")
    fast = np.abs(velocity) > 0.015
    for above_mm_s, feeds in ((10.0, False), (0.0, True)):
        model = LugreResidual(build("lugre_residual", cylinder, 0.02, BLIND, passive_above_mm_s=above_mm_s))
        power = model.fit(turned).estimate(recording)[fast] * velocity[fast]  # of a label that always feeds energy
        assert (power < -1.0).any() == feeds


def with_offsets(recordings: Sequence[Recording], offset_pa: float) -> list[Recording]:
    return [
        one.with_columns(pressure_1_pa=one.column("pressure_1_pa") + (-1) ** number * offset_pa)
        for number, one in enumerate(recordings)
    ]


def test_it_learns_more_than_a_constant_gain_can(cylinder: Cylinder, labelled_recordings: list[Recording]) -> None:
    train, test = labelled_recordings[1:], labelled_recordings[0]
    learnt = LearnedGain(build("learned_gain", cylinder, 0.07, nodes=8)).fit(train)
    assert not learnt.features.strokes
    constant = LowPassForceBalanceEstimator(cylinder).fit(train)
    errors = [np.abs(each.estimate(test) - test.column("friction_n")).mean() for each in (learnt, constant)]
    assert errors[0] < 0.9 * errors[1]


def test_strokes_are_remembered_where_sensors_are_far_off(
    cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    far_off = LearnedGain(build("learned_gain", cylinder, 0.001)).fit(with_offsets(labelled_recordings, 1e5))
    assert far_off.features.strokes
    assert np.isfinite(far_off.estimate(labelled_recordings[0])).all()


def test_training_and_running_track_alike() -> None:
    gain, balance = torch.rand(2, 12, 3, generator=torch.Generator().manual_seed(0))
    tracked, expected = track(gain, balance, balance[0]), [balance[0]]
    for row in range(1, 12):
        expected.append(expected[-1] + gain[row] * (balance[row] - expected[-1]))
    np.testing.assert_allclose(tracked, torch.stack(expected), rtol=1e-5)


def strokes(velocity: Array, balance_n: Array) -> dict[str, Array]:
    rows = remember_strokes(velocity, balance_n, np.full(len(velocity), 30e5))
    return dict(zip(MEMORY_NAMES, rows.T, strict=True))


def test_the_memory_of_strokes_reveals_an_offset() -> None:
    velocity = 0.05 * np.repeat([1.0, -1.0], 1000)
    seen = strokes(velocity, 300.0 * np.sign(velocity) + 40.0)
    both = (1000.0 / 1200.0) ** 2
    assert seen["both_strokes_known"][-1] == pytest.approx(both)
    assert seen["stroke_sum_over_difference"][-1] == pytest.approx(both * 80.0 / 600.0)
    assert seen["stroke_difference"][-1] == pytest.approx(both * 600.0 / 500.0)
    assert seen["pressure_2_out"][-1] == pytest.approx(1000.0 / 1200.0)
    assert seen["speed_in"][-1] == pytest.approx(1000.0 / 1200.0)


def test_the_memory_of_strokes_forgets_nothing_at_rest_and_learns_nothing_of_creep() -> None:
    velocity = np.concatenate([np.full(300, 0.05), np.full(500, 2e-3)])
    balance_n = np.concatenate([np.full(300, 250.0), np.full(500, 900.0)])
    rows = remember_strokes(velocity, balance_n, np.zeros(800))
    np.testing.assert_array_equal(rows[299], rows[-1])
    assert not strokes(velocity, balance_n)["both_strokes_known"].any()
