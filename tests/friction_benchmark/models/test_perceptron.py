"""The perceptron's rows against matrix products and ONNX Runtime; the velocity window; synthetic friction."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Literal

import numpy as np
import onnxruntime
import pytest

from friction_benchmark.models.han import drawn_parameters, generic_parameters, synthetic_friction
from friction_benchmark.models.perceptron import Perceptron, read_perceptron, write_perceptron
from friction_benchmark.models.velocity_window import EVERY, SPANS, advance_window, new_window

if TYPE_CHECKING:
    from pathlib import Path

    from cylinder_friction.cylinder import Cylinder


def made(activation: Literal["tanh", "relu"]) -> Perceptron:
    generator = np.random.default_rng(0)
    sizes = [5, 7, 3, 1]
    pairs = list(itertools.pairwise(sizes))
    kernels = tuple(generator.normal(size=pair).astype(np.float32) for pair in pairs)
    return Perceptron(kernels, tuple(generator.normal(size=after).astype(np.float32) for _, after in pairs), activation)


@pytest.mark.parametrize("activation", ["tanh", "relu"])
def test_rows_agree_with_onnx_runtime_and_survive_storing(activation: Literal["tanh", "relu"], tmp_path: Path) -> None:
    weights = made(activation)
    rows = np.random.default_rng(1).normal(size=(50, 5)).astype(np.float32)
    output = weights.run(rows)
    write_perceptron(tmp_path / "network.onnx", weights)
    read = read_perceptron(tmp_path / "network.onnx")
    np.testing.assert_array_equal(read.run(rows), output)
    session = onnxruntime.InferenceSession(tmp_path / "network.onnx")
    np.testing.assert_allclose(session.run(None, {"features": rows})[0][:, 0], output, atol=1e-5)
    assert weights.multiply_adds() == 5 * 7 + 7 * 3 + 3


def test_layers_that_do_not_fit_are_refused() -> None:
    good = made("relu")
    with pytest.raises(ValueError, match="expected layers that fit each other and end in one output"):
        Perceptron(good.kernels[:2], good.biases[:2], "relu")


def test_the_window_holds_means_over_growing_spans() -> None:
    velocity = 0.05 * np.arange(1.0, EVERY * int(SPANS.sum()) + 1.0)
    window, stepped = advance_window(new_window(), velocity)
    assert stepped.sum() == SPANS.sum()
    seen = velocity[stepped][::-1]
    edges = np.concatenate([[0], np.cumsum(SPANS)])
    means = [seen[start:end].mean() / 0.05 for start, end in itertools.pairwise(edges)]
    np.testing.assert_allclose(window[-1, : len(SPANS)], means, rtol=1e-6)


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
