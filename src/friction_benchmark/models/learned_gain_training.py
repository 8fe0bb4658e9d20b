"""Training of the network that steers a filter's gain: PyTorch for the network, an adjoint by hand for the filter."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numba
import numpy as np
import torch
from torch import nn

from cylinder_friction.estimators.network_training import FrictionNetwork, reproducible, weights_of
from cylinder_friction.estimators.training_plan import Architecture

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from cylinder_friction.realtime.lstm import LstmWeights
    from friction_benchmark.models.learned_gain import GainArchitecture, GainPlan

    Single = NDArray[np.float32]

FIRST_GAIN_LOGIT = -1.0
"""Where the gain begins: 0.27, about the best that is constant."""
WARM_UP = 0.05
"""Share of training over which the learning rate rises to its highest."""


@dataclass(frozen=True)
class TrackingSequence:
    """One recording: features ``(n, k)``; force balance and target in units of the scale, and mask: ``(n,)``.

    The scale is the standard deviation of what the force balance leaves of the target.
    """

    features: Single
    balance: Single
    target: Single
    usable: NDArray[np.bool_]


class GainNetwork(FrictionNetwork):
    """An LSTM whose heads give the gain's logit (``head``) and what is added to the filter's output (``offset``)."""

    def __init__(self, architecture: GainArchitecture, plan: GainPlan, inputs: int) -> None:
        super().__init__(Architecture(1, architecture.nodes, 0.0, plan.learning_rate), inputs)
        self.offset = nn.Linear(architecture.nodes, 1)
        for layer, bias in ((self.head, FIRST_GAIN_LOGIT), (self.offset, 0.0)):
            nn.init.zeros_(layer.weight)
            nn.init.constant_(layer.bias, bias)

    def steer(self, features: torch.Tensor, state: Any) -> tuple[torch.Tensor, torch.Tensor, Any]:
        """Return gains and offsets, each ``(time, batch)``, and the state, for features ``(time, batch, inputs)``."""
        hidden, state = self.lstm(features, state)
        return torch.sigmoid(self.head(hidden)[..., 0]), self.offset(hidden)[..., 0], state


class _Track(torch.autograd.Function):
    """``m[t] = m[t-1] + g[t] (b[t] - m[t-1])``, and its derivative with respect to the gain."""

    @staticmethod
    def forward(ctx: Any, gain: torch.Tensor, balance: torch.Tensor, last: torch.Tensor) -> torch.Tensor:
        gains, balances, first = (part.detach().contiguous().numpy() for part in (gain, balance, last))
        tracked = _forward(gains, balances, first)
        ctx.arrays = (gains, balances, first, tracked)
        return torch.from_numpy(tracked)

    @staticmethod
    def backward(ctx: Any, upstream: torch.Tensor) -> tuple[torch.Tensor, None, None]:
        gains, balances, first, tracked = ctx.arrays
        slope = _backward(gains, balances, first, tracked, upstream.contiguous().numpy())
        return torch.from_numpy(slope), None, None


def track(gain: torch.Tensor, balance: torch.Tensor, last: torch.Tensor) -> torch.Tensor:
    """Return the tracked force, shape ``(time, batch)``, after ``last``, ``(batch,)``; differentiable by the gain."""
    tracked: torch.Tensor = _Track.apply(gain, balance, last)
    return tracked


@numba.njit(cache=True)
def _forward(gain: Single, balance: Single, last: Single) -> Single:
    tracked = np.empty_like(balance)
    for batch in range(balance.shape[1]):
        value = last[batch]
        for time in range(balance.shape[0]):
            value += gain[time, batch] * (balance[time, batch] - value)
            tracked[time, batch] = value
    return tracked


@numba.njit(cache=True)
def _backward(gain: Single, balance: Single, last: Single, tracked: Single, upstream: Single) -> Single:
    """Return the derivative by the gain; the adjoint runs backwards, ``l[t] = u[t] + (1 - g[t+1]) l[t+1]``."""
    slope = np.empty_like(gain)
    one = np.float32(1.0)
    for batch in range(balance.shape[1]):
        adjoint = np.float32(0.0)
        for time in range(balance.shape[0] - 1, -1, -1):
            adjoint += upstream[time, batch]
            before = tracked[time - 1, batch] if time > 0 else last[batch]
            slope[time, batch] = adjoint * (balance[time, batch] - before)
            adjoint *= one - gain[time, batch]
    return slope


def train_gain(
    architecture: GainArchitecture, plan: GainPlan, recordings: Sequence[TrackingSequence], seed: int
) -> tuple[LstmWeights, Single, float]:
    """Train with AdamW (Loshchilov and Hutter 2019) and a cosine schedule on the mean absolute error.

    Returns:
        The network with the gain's head, and weights and bias of the offset's head.

    Raises:
        FloatingPointError: The error is no longer a number.
    """
    with reproducible(seed):
        network = GainNetwork(architecture, plan, recordings[0].features.shape[1])
        optimiser = torch.optim.AdamW(
            network.parameters(), lr=plan.learning_rate, weight_decay=plan.weight_decay, fused=True
        )
        generator = np.random.default_rng(seed)
        groups = math.ceil(len(recordings) / plan.batch_size)
        epochs = max(1, round(plan.lessons / len(recordings)))
        for epoch in range(epochs):
            order = generator.permutation(len(recordings))
            for number in range(groups):
                progress = (epoch + number / groups) / epochs
                rate = plan.learning_rate * min(1.0, progress / WARM_UP + 0.05) * _cosine(progress)
                for parameters in optimiser.param_groups:
                    parameters["lr"] = rate
                group = [recordings[one] for one in order[number * plan.batch_size : (number + 1) * plan.batch_size]]
                error = _train_group(network, optimiser, plan, group, generator)
                if not math.isfinite(error):
                    raise FloatingPointError(
                        f"epoch {epoch + 1}: mean absolute error is {error}; lower the learning rate, now {rate}"
                    )
        offset = network.offset.weight.detach().numpy()[0].copy(), float(network.offset.bias.detach()[0])
        return weights_of(network), *offset


def _cosine(progress: float) -> float:
    return 0.5 * (1.0 + math.cos(math.pi * progress)) + 0.01


def _train_group(
    network: GainNetwork,
    optimiser: torch.optim.Optimizer,
    plan: GainPlan,
    group: Sequence[TrackingSequence],
    generator: np.random.Generator,
) -> float:
    """Take one update a stretch; state and tracked force carry on, the gradient does not. Returns the last error."""
    features, balance, target, weight = _side_by_side(group, plan.burn_in)
    cut = plan.stride * int(generator.integers(plan.stretch // plan.stride))
    edges = sorted({0, *range(cut, len(balance), plan.stretch), len(balance)})
    state, last, mean = None, balance[0].clone(), 0.0
    for start, end in itertools.pairwise(edges):
        gain, offset, state = network.steer(features[start : end : plan.stride], state)
        state = tuple(part.detach() for part in state)
        gain, offset = (part.repeat_interleave(plan.stride, 0)[: end - start] for part in (gain, offset))
        tracked = track(gain, balance[start:end], last)
        last = tracked[-1].detach()
        scored = weight[start:end].sum()
        if float(scored) == 0.0:
            continue
        error = ((tracked + offset - target[start:end]).abs() * weight[start:end]).sum() / scored
        optimiser.zero_grad()
        error.backward()
        nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimiser.step()
        mean = float(error.detach())
    return mean


def _side_by_side(group: Sequence[TrackingSequence], burn_in: int) -> tuple[torch.Tensor, ...]:
    """Return features (time, batch, k), balance, target and weight (time, batch), padded at the end."""
    time, batch = max(len(one.target) for one in group), len(group)
    features = torch.zeros(time, batch, group[0].features.shape[1])
    balance, target, weight = (torch.zeros(time, batch) for _ in range(3))
    for place, one in enumerate(group):
        end = len(one.target)
        features[:end, place] = torch.from_numpy(one.features)
        balance[:end, place] = torch.from_numpy(one.balance)
        target[:end, place] = torch.from_numpy(one.target)
        weight[:end, place] = torch.from_numpy(one.usable.astype(np.float32))
    weight[:burn_in] = 0.0
    return features, balance, target, weight
