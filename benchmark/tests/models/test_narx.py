"""NARX: it finds what is in the data, and cannot run away."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from friction_benchmark.models.narx import (
    CLIP,
    NarxEstimator,
    candidate_terms,
    chosen_terms,
    filtered_terms,
    free_run,
    poles,
)

if TYPE_CHECKING:
    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.recordings.recording import Recording


def test_candidates_are_constant_linear_and_second_degree() -> None:
    terms = candidate_terms(present=2, columns=3)
    assert {tuple(term) for term in terms} == {(0, 0), (1, 0), (2, 0), (3, 0), (1, 1), (2, 1), (2, 2)}


def test_forward_regression_takes_the_true_terms_first() -> None:
    generator = np.random.default_rng(0)
    columns = np.column_stack([np.ones(4000), generator.normal(size=(4000, 5))])
    terms = candidate_terms(5, 5)
    regressors = filtered_terms(columns, terms, np.zeros(4000), 1)
    true = [int(np.flatnonzero((terms == pair).all(axis=1))[0]) for pair in ((3, 0), (4, 2))]
    target = 3.0 * regressors[:, true[0]] - 2.0 * regressors[:, true[1]] + generator.normal(0.0, 0.1, 4000)
    found = chosen_terms(regressors.T @ regressors, regressors.T @ target, 4)
    assert set(found[:2]) == set(true)


def test_collinear_terms_are_taken_once() -> None:
    column = np.random.default_rng(0).normal(size=500)
    regressors = np.column_stack([column, column, 2.0 * column])
    assert len(chosen_terms(regressors.T @ regressors, regressors.T @ column, 3)) == 1


def test_the_free_run_is_linear_in_the_weights_behind_its_own_poles() -> None:
    generator = np.random.default_rng(2)
    columns = np.column_stack([np.ones(300), generator.normal(size=(300, 3))])
    terms = candidate_terms(3, 3)
    kept = poles(generator.uniform(-1.0, 1.0, 300), 0.5, 0.95)
    weights = generator.normal(size=len(terms))
    run = free_run(columns, terms, weights, kept, np.full(1, np.nan))
    np.testing.assert_allclose(filtered_terms(columns, terms, kept, 1) @ weights, run, rtol=1e-9, atol=1e-9)


@settings(max_examples=25, deadline=None)
@given(
    at_rest=st.floats(0.0, 0.98), sliding=st.floats(0.0, 0.98), creep=st.floats(-1.5, 1.5), start=st.floats(-1e6, 1e6)
)
def test_whatever_comes_in_the_output_is_bounded_and_forgets_its_start(
    at_rest: float, sliding: float, creep: float, start: float
) -> None:
    columns = np.column_stack([np.ones(3000), np.full((3000, 2), CLIP)])
    terms = candidate_terms(2, 2)
    kept = poles(np.full(3000, creep), at_rest, sliding)
    assert (kept >= 0.0).all()
    assert (kept <= 0.98).all()
    run = free_run(columns, terms, np.ones(len(terms)), kept, np.full(1, start))
    bound = float(np.abs(columns[0, terms[:, 0]] * columns[0, terms[:, 1]]).sum())
    assert abs(run[-1]) <= bound * (1.0 + 1e-9)
    assert run[-1] == pytest.approx(free_run(columns, terms, np.ones(len(terms)), kept, np.zeros(1))[-1])


def test_wild_sensors_leave_it_finite(cylinder: Cylinder, labelled_recordings: list[Recording]) -> None:
    estimator = NarxEstimator(cylinder, terms=20, rows=3000)
    estimator.fit(labelled_recordings)
    wild = labelled_recordings[0].samples() * np.random.default_rng(0).normal(0.0, 1e3, (4000, 3))
    correction = (
        estimator.advance(estimator.new_state(), wild)
        - estimator._block.advance(  # type: ignore[union-attr]
            estimator._block.new_state(),  # type: ignore[union-attr]
            wild,
        )[1]
    )
    assert np.abs(correction).max() < estimator.target_scale_n * np.abs(
        estimator._weights
    ).sum() * CLIP**2 * 1.01 + abs(estimator.target_mean_n)


def test_an_impossible_number_of_terms_is_refused(cylinder: Cylinder) -> None:
    with pytest.raises(ValueError, match="expected at least one term and row, but got 0 terms"):
        NarxEstimator(cylinder, terms=0)
