"""One training loop for the networks in PyTorch that the product's own training does not cover."""

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from friction_benchmark.models.base import Single


def minimise(
    parameters: Iterable[torch.Tensor],
    losses: Iterable[tuple[float, torch.Tensor]],
    learning_rate: float,
    *,
    weight_decay: float = 0.0,
    warm_up: float = 0.0,
) -> None:
    """Take one step of AdamW for each loss, with a rate that falls with a cosine; gradients are clipped at norm 1.

    Each loss, of a batch and with the progress in [0, 1), is made after the step before it. ``warm_up`` is the share of
    training over which the rate rises to its maximum. AdamW: Loshchilov and Hutter 2019; without decay it is Adam,
    Kingma and Ba 2015.
    """
    trained = list(parameters)
    optimiser = torch.optim.AdamW(trained, lr=learning_rate, weight_decay=weight_decay, fused=True)
    for progress, loss in losses:
        if not math.isfinite(float(loss.detach())):
            raise FloatingPointError(f"the error is {float(loss.detach())}; lower the learning rate {learning_rate}")
        rise = min(1.0, progress / warm_up + 0.05) if warm_up else 1.0
        optimiser.param_groups[0]["lr"] = learning_rate * rise * (0.51 + 0.5 * math.cos(math.pi * progress))
        optimiser.zero_grad()
        torch.autograd.backward(loss)
        nn.utils.clip_grad_norm_(trained, 1.0)
        optimiser.step()


def perceptron(inputs: int, nodes: Sequence[int], activation: type[nn.Module]) -> nn.Sequential:
    """Return layers of these widths with an activation after each, and one linear output."""
    sizes = [inputs, *nodes, 1]
    layers = [(nn.Linear(before, after), activation()) for before, after in pairwise(sizes)]
    return nn.Sequential(*[part for pair in layers for part in pair][:-1])


def outputs(network: nn.Module, rows: NDArray[np.floating]) -> Single:
    """Return a network's only output at each row, shape ``(n,)``."""
    with torch.inference_mode():
        weight = next(network.parameters())
        return np.asarray(network(torch.from_numpy(np.ascontiguousarray(rows)).to(weight.dtype))[:, 0], np.float32)


def weights_in(network: nn.Module) -> int:
    """Return how many weights are not biases: the multiply-adds of one step."""
    return sum(weight.numel() for weight in network.parameters() if weight.dim() > 1)
