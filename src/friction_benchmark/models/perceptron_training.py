"""Training of a perceptron with Adam in PyTorch."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import nn

from cylinder_friction.estimators.network_training import reproducible
from friction_benchmark.models.perceptron import Perceptron

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Single = NDArray[np.float32]

BATCH = 1024
LOOKS = 20
"""Times that training looks at rows which it does not learn from."""


def new_perceptron(inputs: int, nodes: Sequence[int], seed: int) -> Perceptron:
    """Return a rectified perceptron with PyTorch's usual first weights (He et al. 2015)."""
    with reproducible(seed):
        sizes = [inputs, *nodes, 1]
        layers = [nn.Linear(before, after) for before, after in itertools.pairwise(sizes)]
    return _weights(layers)


def train_perceptron(
    start: Perceptron,
    rows: Single,
    targets: Single,
    steps: int,
    learning_rate: float,
    seed: int,
    unseen: tuple[Single, Single] | None = None,
) -> Perceptron:
    """Return the weights after ``steps`` batches, or those of the look at which unseen rows are estimated best.

    Mean absolute error; Adam (Kingma and Ba 2015) with a learning rate that falls with a cosine.

    Args:
        start: First weights; rectified.
        rows: Shape ``(n, inputs)``.
        targets: Shape ``(n,)``; or ``(n, variants)``, of which each row of a batch draws one.
        steps: Batches.
        learning_rate: At the start.
        seed: Of the batches.
        unseen: Rows and targets that stop training early.
    """
    with reproducible(seed):
        layers = [_layer(kernel, bias) for kernel, bias in zip(start.kernels, start.biases, strict=True)]
        network = nn.Sequential(*[part for layer in layers for part in (layer, nn.ReLU())][:-1])
        optimiser = torch.optim.Adam(network.parameters(), lr=learning_rate, fused=True)
        generator = np.random.default_rng([seed, 2])
        variants = targets if targets.ndim == 2 else targets[:, None]
        best, kept = math.inf, start
        for step in range(1, steps + 1):
            for group in optimiser.param_groups:
                group["lr"] = learning_rate * (0.5 + 0.5 * math.cos(math.pi * (step - 1) / steps))
            drawn = generator.integers(len(rows), size=BATCH)
            target = variants[drawn, generator.integers(variants.shape[1], size=BATCH)]
            output = network(torch.from_numpy(rows[drawn])).squeeze(-1)
            error = (output - torch.from_numpy(target)).abs().mean()
            optimiser.zero_grad()
            error.backward()
            optimiser.step()
            if unseen is not None and (step * LOOKS // steps > (step - 1) * LOOKS // steps or step == steps):
                with torch.no_grad():
                    left = network(torch.from_numpy(unseen[0])).squeeze(-1) - torch.from_numpy(unseen[1])
                if float(left.abs().mean()) < best:
                    best, kept = float(left.abs().mean()), _weights(layers)
    return _weights(layers) if unseen is None else kept


def last_hidden(weights: Perceptron, rows: Single) -> Single:
    """Return the last hidden layer's outputs, shape ``(n, nodes)``, of a rectified perceptron."""
    values = rows
    for kernel, bias in zip(weights.kernels[:-1], weights.biases[:-1], strict=True):
        values = np.maximum(values @ kernel + bias, np.float32(0.0))
    return values


def _layer(kernel: Single, bias: Single) -> nn.Linear:
    layer = nn.Linear(*kernel.shape)
    with torch.no_grad():
        layer.weight.copy_(torch.from_numpy(kernel.T.copy()))
        layer.bias.copy_(torch.from_numpy(bias))
    return layer


def _weights(layers: Sequence[nn.Linear]) -> Perceptron:
    return Perceptron(
        tuple(np.ascontiguousarray(layer.weight.detach().numpy().T).copy() for layer in layers),
        tuple(layer.bias.detach().numpy().copy() for layer in layers),
        "relu",
    )
