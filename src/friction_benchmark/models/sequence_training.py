"""Training of any sequence network in PyTorch: whole recordings side by side, state carried, output held between steps.

The error is that of the held output at every sample, so what is trained is what runs. The state carries on from one
stretch to the next and the gradient does not (truncated backpropagation through time; Williams and Peng 1990).
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch import nn

from cylinder_friction.estimators.network_training import SideBySide, reproducible, side_by_side
from cylinder_friction.estimators.training_plan import LearningCurve, SequenceData

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from friction_benchmark.models.sequence_estimator import SequencePlan

WARM_UP = 0.05
"""Share of training over which the learning rate rises to its highest."""
BURN_IN_SAMPLES = 100
"""Of a stretch that does not begin where its recording does, not scored while the state finds its place."""


def train_sequences(
    make_network: Callable[[int], nn.Module],
    learning_rate: float,
    plan: SequencePlan,
    train: Sequence[SequenceData],
    seed: int,
) -> tuple[nn.Module, LearningCurve]:
    """Train with AdamW (Loshchilov and Hutter 2019), cosine schedule; return the last epoch's network.

    Args:
        make_network: Takes the number of features, returns ``(features, state) -> (output, state)``: features
            ``(time, batch, k)``, output ``(time, batch)``, state None at first, else tensors or nested tuples of them.
        learning_rate: The highest.
        plan: Of the training.
        train: Recordings that are learnt from.
        seed: Of weights, dropout, order of recordings, and where they are cut.

    Raises:
        FloatingPointError: The error is no longer a number.
    """
    with reproducible(seed):
        network = make_network(train[0].features.shape[1])
        optimiser = torch.optim.AdamW(
            network.parameters(), lr=learning_rate, weight_decay=plan.weight_decay, fused=True
        )
        rows = side_by_side(_cut(train, plan.cut_samples))
        curve = LearningCurve()
        generator = np.random.default_rng(seed)
        for epoch in range(1, plan.epochs + 1):
            trained = _train_epoch(network, optimiser, rows, plan, learning_rate, epoch, generator)
            if not math.isfinite(trained):
                raise FloatingPointError(
                    f"epoch {epoch}: mean absolute error is {trained}; lower the learning rate, now {learning_rate}"
                )
            curve.train_mae.append(trained)
            curve.best_epoch = epoch
        return network.eval(), curve


def _cut(recordings: Sequence[SequenceData], longest: int) -> list[SequenceData]:
    """Return the recordings in stretches of equal length, none longer than ``longest`` samples (0: whole)."""
    result = []
    for recording in recordings:
        rows = len(recording.target)
        count = math.ceil(rows / longest) if longest else 1
        edges = [rows * part // count for part in range(count + 1)]
        for start, end in itertools.pairwise(edges):
            usable = recording.usable[start:end].copy()
            if start > 0:
                usable[:BURN_IN_SAMPLES] = False
            result.append(SequenceData(recording.features[start:end], recording.target[start:end], usable))
    return result


@dataclass(frozen=True)
class _Steps:
    """Features at the network's steps, ``(steps, batch, k)``; target and weight of the samples that each step's output
    is held for, ``(steps, stride, batch)``; steps in each recording, ``(batch,)``."""

    features: torch.Tensor
    target: torch.Tensor
    weight: torch.Tensor
    lengths: torch.Tensor

    def part(self, start: int, end: int, group: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        return self.features[start:end, group], self.target[start:end, :, group], self.weight[start:end, :, group]


def _strided(rows: SideBySide, stride: int, phase: int) -> _Steps:
    """Return the steps of recordings whose first ``phase`` samples are left out."""
    steps = (rows.target.shape[0] - phase) // stride
    end = phase + steps * stride
    shape = (steps, stride, rows.target.shape[1])
    return _Steps(
        rows.features[phase:end:stride],
        rows.target[phase:end].reshape(shape),
        rows.weight[phase:end].reshape(shape),
        (rows.lengths - phase) // stride,
    )


def _train_epoch(
    network: nn.Module,
    optimiser: torch.optim.Optimizer,
    rows: SideBySide,
    plan: SequencePlan,
    learning_rate: float,
    epoch: int,
    generator: np.random.Generator,
) -> float:
    network.train()
    parameters = [one for group in optimiser.param_groups for one in group["params"]]
    steps = _strided(rows, plan.stride, int(generator.integers(plan.stride)))
    shift = int(generator.integers(1, plan.sequence_steps + 1))
    order = torch.as_tensor(generator.permutation(len(rows.lengths)))
    pieces = []
    for group in order.split(plan.batch_size):
        length = int(steps.lengths[group].max())
        edges = [0, *range(shift, length, plan.sequence_steps), length]
        pieces += [(start, end, group) for start, end in itertools.pairwise(edges)]
    state, total, count = None, 0.0, 0.0
    for number, (start, end, group) in enumerate(pieces):
        _set_rate(optimiser, learning_rate, (epoch - 1 + number / len(pieces)) / plan.epochs)
        features, target, weight = steps.part(start, end, group)
        output, state = network(features, state if start > 0 else None)
        state = _detached(state)
        scored = float(weight.sum())
        if scored == 0.0:
            continue
        error = (output[:, None] - target).abs()
        loss = (_cost(error, plan.huber) * weight).sum() / scored
        optimiser.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(parameters, 1.0)
        optimiser.step()
        total, count = total + float((error.detach() * weight).sum()), count + scored
    return total / max(count, 1.0)


def _cost(error: torch.Tensor, huber: float) -> torch.Tensor:
    """Return Huber's cost of an absolute error, divided by its bend so that its slope ends at 1 (Huber 1964)."""
    if huber == 0.0:
        return error
    return torch.where(error < huber, 0.5 * error**2 / huber, error - 0.5 * huber)


def _set_rate(optimiser: torch.optim.Optimizer, highest: float, progress: float) -> None:
    factor = progress / WARM_UP if progress < WARM_UP else 0.5 * (1.0 + math.cos(math.pi * progress))
    for group in optimiser.param_groups:
        group["lr"] = highest * (0.01 + 0.99 * factor)


def _detached(state: Any) -> Any:
    return state.detach() if isinstance(state, torch.Tensor) else tuple(_detached(part) for part in state)
