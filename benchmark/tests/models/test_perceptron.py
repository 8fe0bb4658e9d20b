"""The perceptron's rows against ONNX Runtime, and its file."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Literal

import numpy as np
import onnxruntime
import pytest

from friction_benchmark.models.perceptron import Perceptron, read_perceptron, write_perceptron

if TYPE_CHECKING:
    from pathlib import Path


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
