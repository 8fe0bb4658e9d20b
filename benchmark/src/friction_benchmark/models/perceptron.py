"""The multilayer perceptron: run row by row from plain arrays, stored as ONNX, trained in PyTorch, and as an estimator.

Layer by layer ``x <- f(x W + b)`` with f the hyperbolic tangent or the rectifier; the last layer is linear and has one
output. A row's output follows from that row alone, so cutting the rows into pieces changes no bit.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Generic, Literal, Self, TypeVar

import numba
import numpy as np
import onnx.checker
import onnx.parser
from onnx import numpy_helper

from cylinder_friction.estimators.onnx_files import IR_VERSION, OPSET, write_onnx
from cylinder_friction.realtime.lstm import tanh
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from friction_benchmark.models.learned import NETWORK_FILE, LearnedEstimator

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray
    from torch import nn

    from cylinder_friction.cylinder import Cylinder

    Single = NDArray[np.float32]

Plan = TypeVar("Plan")
BATCH = 1024


@dataclass(frozen=True)
class Perceptron:
    """Weights of a perceptron.

    Attributes:
        kernels: One per layer, shape ``(nodes before, nodes)``, float32; the last has one column.
        biases: One per layer, shape ``(nodes,)``, float32.
        activation: After every layer but the last.

    Raises:
        ValueError: The layers do not fit each other, or there is not one output.
    """

    kernels: tuple[Single, ...]
    biases: tuple[Single, ...]
    activation: Literal["tanh", "relu"]

    def __post_init__(self) -> None:
        shapes = [kernel.shape for kernel in self.kernels]
        fit = all(before[1] == after[0] for before, after in itertools.pairwise(shapes))
        if not shapes or not fit or shapes[-1][1] != 1 or [len(bias) for bias in self.biases] != [s[1] for s in shapes]:
            raise ValueError(
                f"expected layers that fit each other and end in one output, but got kernels {shapes} and biases "
                f"{[bias.shape for bias in self.biases]}"
            )

    def multiply_adds(self) -> int:
        """Return the multiply-adds of one row."""
        return sum(kernel.size for kernel in self.kernels)

    def run(self, rows: Single) -> Single:
        """Return the output, shape ``(n,)``, of rows, shape ``(n, inputs)``."""
        sizes = np.array([len(self.kernels[0]), *(kernel.shape[1] for kernel in self.kernels)], dtype=np.int64)
        return _run(sizes, self._flat, self.activation == "relu", np.ascontiguousarray(rows, dtype=np.float32))

    @cached_property
    def _flat(self) -> Single:
        parts = [part.ravel() for pair in zip(self.kernels, self.biases, strict=True) for part in pair]
        return np.concatenate(parts).astype(np.float32)


@numba.njit(cache=True)
def _run(sizes: NDArray[np.int64], flat: Single, rectified: bool, rows: Single) -> Single:
    result = np.empty(rows.shape[0], dtype=np.float32)
    layers = np.empty((2, sizes.max()), dtype=np.float32)
    for row in range(rows.shape[0]):
        place = 0
        for node in range(sizes[0]):
            layers[0, node] = rows[row, node]
        for layer in range(sizes.shape[0] - 1):
            before, nodes = sizes[layer], sizes[layer + 1]
            source, target = layers[layer % 2], layers[(layer + 1) % 2]
            bias = flat[place + before * nodes : place + (before + 1) * nodes]
            for node in range(nodes):
                target[node] = bias[node]
            for index in range(before):
                value, kernel = source[index], flat[place + index * nodes : place + (index + 1) * nodes]
                for node in range(nodes):
                    target[node] += value * kernel[node]
            place += (before + 1) * nodes
            if layer < sizes.shape[0] - 2:
                for node in range(nodes):
                    target[node] = max(target[node], np.float32(0.0)) if rectified else tanh(target[node])
        result[row] = layers[(sizes.shape[0] - 1) % 2, 0]
    return result


def write_perceptron(path: Path, weights: Perceptron) -> None:
    """Write the checked graph: ``features`` (rows, inputs) to ``output`` (rows, 1), float32."""
    nodes, constants, source = [], [], "features"
    for layer, parts in enumerate(zip(weights.kernels, weights.biases, strict=True)):
        names = (f"layer{layer}_kernel", f"layer{layer}_bias")
        constants += [numpy_helper.from_array(part, name) for part, name in zip(parts, names, strict=True)]
        last = layer == len(weights.kernels) - 1
        target = "output" if last else f"layer{layer}_sum"
        nodes.append(f"{target} = Gemm ({source}, {', '.join(names)})")
        source = f"layer{layer}_output"
        if not last:
            nodes.append(f"{source} = {'Relu' if weights.activation == 'relu' else 'Tanh'} ({target})")
    header = f'<ir_version: {IR_VERSION}, opset_import: ["": {OPSET}]>'
    signature = f"perceptron (float[rows, {len(weights.kernels[0])}] features) => (float[rows, 1] output)"
    model = onnx.parser.parse_model(f"{header} {signature} {{ {' '.join(nodes)} }}")
    model.graph.initializer.extend(constants)
    onnx.checker.check_model(model, full_check=True)
    write_onnx(model, path)


def read_perceptron(path: Path) -> Perceptron:
    """Return the perceptron that ``write_perceptron`` wrote."""
    model = onnx.load(path)
    stored = {tensor.name: numpy_helper.to_array(tensor) for tensor in model.graph.initializer}
    layers = range(len(stored) // 2)
    rectified = any(node.op_type == "Relu" for node in model.graph.node)
    return Perceptron(
        tuple(stored[f"layer{layer}_kernel"] for layer in layers),
        tuple(stored[f"layer{layer}_bias"] for layer in layers),
        "relu" if rectified else "tanh",
    )


def new_perceptron(inputs: int, nodes: Sequence[int], seed: int) -> Perceptron:
    """Return a rectified perceptron with PyTorch's usual first weights (He et al. 2015)."""
    from torch import nn  # only training needs it

    from cylinder_friction.estimators.training import reproducible

    with reproducible(seed):
        return _weights_of([nn.Linear(*sizes) for sizes in itertools.pairwise([inputs, *nodes, 1])])


def train_perceptron(
    start: Perceptron, rows: Single, targets: Single, steps: int, learning_rate: float, seed: int
) -> Perceptron:
    """Train on the mean absolute error with Adam (Kingma and Ba 2015), whose learning rate falls with a cosine.

    Args:
        start: First weights; rectified.
        rows: Shape ``(n, inputs)``.
        targets: Shape ``(n,)``; or ``(n, variants)``, of which each row of a batch draws one.
        steps: Batches.
        learning_rate: At the start.
        seed: Seeds the batches.
    """
    import torch
    from torch import nn

    from cylinder_friction.estimators.training import reproducible

    with reproducible(seed):
        layers = []
        for kernel, bias in zip(start.kernels, start.biases, strict=True):
            layers.append(nn.Linear(*kernel.shape))
            parameters = {"weight": torch.from_numpy(kernel.T.copy()), "bias": torch.from_numpy(bias)}
            layers[-1].load_state_dict(parameters)
        network = nn.Sequential(*[part for layer in layers for part in (layer, nn.ReLU())][:-1])
        optimiser = torch.optim.Adam(network.parameters(), lr=learning_rate, fused=True)
        schedule = torch.optim.lr_scheduler.LambdaLR(
            optimiser, lambda step: 0.5 + 0.5 * math.cos(math.pi * step / steps)
        )
        generator = np.random.default_rng([seed, 2])
        variants = targets if targets.ndim == 2 else targets[:, None]
        for _ in range(steps):
            drawn = generator.integers(len(rows), size=BATCH)
            target = variants[drawn, generator.integers(variants.shape[1], size=BATCH)]
            error = (network(torch.from_numpy(rows[drawn])).squeeze(-1) - torch.from_numpy(target)).abs().mean()
            optimiser.zero_grad()
            error.backward()
            optimiser.step()
            schedule.step()
        return _weights_of(layers)


def _weights_of(layers: Sequence[nn.Linear]) -> Perceptron:
    return Perceptron(
        tuple(np.ascontiguousarray(layer.weight.detach().numpy().T).copy() for layer in layers),
        tuple(layer.bias.detach().numpy().copy() for layer in layers),
        "relu",
    )


class PerceptronEstimator(LearnedEstimator, Generic[Plan]):
    """A learned estimator whose model is a perceptron, beside a plan of how it was built.

    A subclass gives the type of its plan, a dataclass of plain values with defaults; ``learn``, which sets ``network``
    (None before); ``new_memory`` and ``predict``.
    """

    plan_type: ClassVar[type]

    def __init__(
        self, cylinder: Cylinder, inputs: Sequence[str] = SAMPLE_COLUMNS, plan: Plan | None = None, seed: int = 0
    ) -> None:
        super().__init__(cylinder, inputs, seed)
        self.plan: Plan = plan or self.plan_type()
        self.network: Perceptron | None = None

    def model_multiply_adds(self) -> int:
        """Return those of one step of the network: the worst case where it does not step at every sample."""
        assert self.network is not None
        return self.network.multiply_adds()

    def write_model(self, folder: Path) -> dict[str, Any]:
        assert self.network is not None
        write_perceptron(folder / NETWORK_FILE, self.network)
        return {"plan": vars(self.plan), "seed": self.seed}

    @classmethod
    def read_model(cls, folder: Path, content: dict[str, Any], cylinder: Cylinder, inputs: Sequence[str]) -> Self:
        estimator = cls(cylinder, inputs, cls.plan_type(**content["plan"]), content["seed"])
        estimator.network = read_perceptron(folder / NETWORK_FILE)
        return estimator
