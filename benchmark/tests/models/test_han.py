"""The network of Han: synthetic friction, and what fine-tuning adds."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from friction_benchmark.models.han import (
    HanEstimator,
    HanPlan,
    drawn_parameters,
    generic_parameters,
    synthetic_friction,
)

if TYPE_CHECKING:
    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.recordings.recording import Recording


def test_the_generic_cylinder_is_passive_and_its_draws_stay_near(cylinder: Cylinder) -> None:
    centre = generic_parameters(cylinder)
    assert centre.is_passive()
    assert centre.static_n == pytest.approx(1.2e5 * cylinder.piston_area_m2)
    generator = np.random.default_rng(0)
    draws = [drawn_parameters(centre, 0.4, generator) for _ in range(200)]
    ratios = np.array([draw.coulomb_n / centre.coulomb_n for draw in draws])
    assert 0.6 <= ratios.min() < 0.65
    assert 1.35 < ratios.max() <= 1.4
    assert all(draw.static_n >= draw.coulomb_n and draw.retract_ratio >= 1.0 for draw in draws)


def test_synthetic_friction_of_steady_sliding_is_the_curve(cylinder: Cylinder) -> None:
    centre = generic_parameters(cylinder)
    friction = synthetic_friction(centre, np.full(400, 0.05), 0.005)
    assert friction[-1] == pytest.approx(float(centre.curve.friction(np.array([0.05]))[0]), rel=1e-6)


def test_without_fine_tuning_no_label_is_learnt_from(cylinder: Cylinder, labelled_recordings: list[Recording]) -> None:
    plan = HanPlan(fine_tuned=False, synthetic_steps=5)
    other = [r.with_columns(friction_n=7.0 - 3.0 * r.column("friction_n")) for r in labelled_recordings]
    estimates = []
    for recordings in (labelled_recordings, other):
        estimator = HanEstimator(cylinder, plan=plan)
        estimator.fit(recordings)
        estimates.append(estimator.estimate(labelled_recordings[0]))
    np.testing.assert_array_equal(*estimates)


def test_without_fine_tuning_pressures_are_not_looked_at(
    cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    estimator = HanEstimator(cylinder, plan=HanPlan(fine_tuned=False, synthetic_steps=5))
    estimator.fit(labelled_recordings)
    samples = labelled_recordings[0].samples()
    without = samples * [0.0, 0.0, 1.0]
    np.testing.assert_array_equal(
        estimator.advance(estimator.new_state(), samples), estimator.advance(estimator.new_state(), without)
    )


def test_fine_tuning_gains_on_synthetic_friction_of_another_cylinder(
    cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    errors_n = []
    for fine_tuned in (False, True):
        plan = HanPlan(fine_tuned, synthetic_steps=60, tuning_steps=120)
        estimator = HanEstimator(cylinder, ("position_m",), plan).fit(labelled_recordings)
        errors = [np.abs(estimator.estimate(r) - r.column("friction_n")).mean() for r in labelled_recordings]
        errors_n.append(np.mean(errors))
    assert errors_n[1] < 0.8 * errors_n[0]


def test_an_impossible_plan_is_refused() -> None:
    with pytest.raises(ValueError, match="expected layers, nodes and steps of at least 1 and a spread"):
        HanPlan(fine_tuned=True, spread=1.0)
