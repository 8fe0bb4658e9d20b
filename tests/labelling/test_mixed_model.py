"""The likelihood and the effects found from sums of products are those of the dense covariance of all rows."""

import numpy as np
import pytest

from cylinder_friction.labelling.mixed_model import Evidence, solved

SIZE, EFFECTS, NOISE, STROKE = 4, 2, 0.7, 1.3
LENGTHS = ((3, 1, 3, 8), (5,), (), (1, 1, 2))
"""Rows of each stroke of each group: equally many, one alone, and a group without any."""


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("lengths", [LENGTHS, LENGTHS[:1], ((),)], ids=["several", "one", "nothing"])
def test_sums_say_what_the_dense_covariance_says(lengths: tuple[tuple[int, ...], ...], seed: int) -> None:
    generator = np.random.default_rng(seed)
    rows = np.array([sum(group) for group in lengths])
    strokes = [length for group in lengths for length in group]
    group, stroke = np.repeat(np.arange(len(rows)), rows), np.repeat(np.arange(len(strokes)), strokes)
    own, design, label = (generator.standard_normal((rows.sum(), many)) for many in (EFFECTS, SIZE, 1))
    deviations = generator.uniform(0.1, 3.0, (len(rows), EFFECTS))
    precision, moment = np.diag(generator.uniform(0.5, 2.0, SIZE)), generator.standard_normal(SIZE)

    parts = Evidence.of(np.hstack([own, design, label]), EFFECTS, rows, stroke).reduced(NOISE, STROKE, deviations)
    found = solved(precision, moment, parts)
    means, uncertainties = found.last_effect(parts)

    scaled = own * deviations[group]
    covariance = NOISE**2 * np.eye(len(label)) + STROKE**2 * np.equal.outer(stroke, stroke)
    covariance += (scaled @ scaled.T) * np.equal.outer(group, group)
    weighted = np.linalg.solve(covariance, np.hstack([design, label]))
    expected_precision = precision + design.T @ weighted[:, :SIZE]
    expected = np.linalg.solve(expected_precision, moment + design.T @ weighted[:, SIZE])
    likelihood = np.linalg.slogdet(covariance)[1] + np.linalg.slogdet(expected_precision)[1]
    likelihood += float((label.T @ weighted[:, SIZE:]).item()) - (moment + design.T @ weighted[:, SIZE]) @ expected
    np.testing.assert_allclose(found.precision, expected_precision, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(found.coefficients, expected, rtol=1e-9, atol=1e-9)
    assert found.minus_twice_likelihood == pytest.approx(likelihood, rel=1e-9)

    shared = np.equal.outer(np.arange(len(rows)), group) * own[:, -1] * deviations[:, -1:] ** 2
    gained = np.linalg.solve(covariance, shared.T)
    across = design.T @ gained
    variances = deviations[:, -1] ** 2 - (shared.T * gained).sum(axis=0)
    variances += (across * np.linalg.solve(expected_precision, across)).sum(axis=0)
    np.testing.assert_allclose(means, gained.T @ (label[:, 0] - design @ expected), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(uncertainties, np.sqrt(variances), rtol=1e-9)
