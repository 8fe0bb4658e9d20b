"""Friction by an Elman network trained by a swarm and a simplex, and the same network trained by Adam.

Source: Pan et al. 2017, Advances in Mechanical Engineering, doi 10.1177/1687814017744473. Only its abstract was at
hand: Elman network; multi-agent particle swarm, then Nelder and Mead's downhill simplex; better than LuGre at low
speed. The models' ``chosen`` states what was taken where it leaves something open.

``x_c(k) = x(k-1) + a x_c(k-1)``, ``x(k) = tanh(u(k) W_u + x_c(k) W_c + b)``, ``y(k) = x(k) w + b_o``: Elman 1990 with
the context's self-feedback a of Pham and Liu 1992. All weights lie in one vector, in the order W_u, W_c, b, w, b_o.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np
import torch

from cylinder_friction.arrays import Array
from cylinder_friction.estimators.training import reproducible
from cylinder_friction.estimators.training_plan import SequenceData
from friction_benchmark.models.base import Single
from friction_benchmark.models.related_work import VELOCITIES, MotionModel, smoothed_absolute
from friction_benchmark.models.swarm import SIDE, swarm_then_simplex
from friction_benchmark.models.training import minimise
from friction_benchmark.registry import BuildConfiguration, Float, Int, RegisteredModel, Space

Trainer = Literal["swarm", "adam"]
STRIDE = 4
"""Samples between two steps, 20 ms at 200 Hz, when friction itself is the network's output, held between. A network
that corrects a force balance steps at every sample: a correction of noise that has passed would be noise."""
SEGMENTS, SEGMENT_STEPS, BURN_IN = 64, 250, 25
"""Pieces of the training recordings used for training, their length, and the steps before the first scored one."""
EVALUATIONS = 16_000
GRADIENT_EVALUATIONS = 3  # One gradient: forward, and backward at about twice the operations


@dataclass(frozen=True)
class Batch:
    """Sequences side by side, all of one length."""

    inputs: torch.Tensor  # Shape ``(steps, sequences, k)``
    target: torch.Tensor  # Shape ``(steps, sequences)``, as the weight
    weight: torch.Tensor  # 1 where a step is scored, else 0


class Elman(MotionModel):
    """An Elman network on velocity and the task's other columns; gives friction or corrects the force balance.

    Effort cuts the evaluations of the network over all training rows; a gradient counts as three.
    """

    def __init__(self, trainer: Trainer, build: BuildConfiguration) -> None:
        super().__init__(build)
        self.trainer, self.evaluations = trainer, build.share(EVALUATIONS)
        self.nodes, self.feedback = build.whole("nodes"), build.number("feedback")

    def learn(self, train: Sequence[SequenceData]) -> None:
        batch = self._batch(train)
        with reproducible(self.seed):
            self.weights = self._by_swarm(batch) if self.trainer == "swarm" else self._by_gradient(batch)

    def predict(self, features: Single) -> Array:
        stride, rows = self._stride(), self._inputs(features)
        with torch.inference_mode():
            inputs = torch.from_numpy(rows[::stride].astype(np.float64))[:, None]
            steps = network_outputs(torch.from_numpy(self.weights), self.nodes, self.feedback, inputs)
        return np.repeat(steps[:, 0].numpy(), stride)[: len(features)]

    def model_multiply_adds(self) -> int:
        """Return those of one step of the network, which comes at every fourth sample at best: the worst case."""
        return len(self.weights)

    def _inputs(self, features: Single) -> Single:
        """Return what the network sees, shape ``(n, k)``."""
        motion = self.named(features, *VELOCITIES)
        return np.column_stack((motion, self.others(features), self.last_motion(features))).astype(np.float32)

    def _stride(self) -> int:
        return 1 if self.features.has_base else STRIDE

    def _batch(self, recordings: Sequence[SequenceData]) -> Batch:
        """Return pieces from places drawn at random, as many of each recording as of the others."""
        generator = np.random.default_rng([self.seed, 1])
        stride = self._stride()
        length = min(SEGMENT_STEPS, *(len(each.target) // stride for each in recordings))
        inputs = [self._inputs(each.features) for each in recordings]
        pieces = []
        for index in range(SEGMENTS):
            number = index % len(recordings)
            chosen = recordings[number]
            start = int(generator.integers(len(chosen.target) - stride * (length - 1)))
            rows = slice(start, start + stride * (length - 1) + 1, stride)
            pieces.append((inputs[number][rows], chosen.target[rows], chosen.usable[rows]))
        stacked = (np.stack(part, axis=1).astype(np.float64) for part in zip(*pieces, strict=True))
        batch = Batch(*(torch.from_numpy(part) for part in stacked))
        batch.weight[:BURN_IN] = 0.0
        return batch

    def _cost(self, weights: torch.Tensor, batch: Batch) -> torch.Tensor:
        """Return the mean cost over the scored steps, differentiable by the weights."""
        error = network_outputs(weights, self.nodes, self.feedback, batch.inputs) - batch.target
        return (smoothed_absolute(error) * batch.weight).sum() / batch.weight.sum()

    def _by_swarm(self, batch: Batch) -> Array:
        corner = np.full(weight_count(batch.inputs.shape[2], self.nodes), self.build.number("bound"))
        budget = max(self.evaluations, SIDE**2)

        def cost(position: Array) -> float:
            return self._cost(torch.from_numpy(position), batch).item()

        with torch.inference_mode():
            return swarm_then_simplex(cost, -corner, corner, budget, self.seed)

    def _by_gradient(self, batch: Batch) -> Array:
        """Return the best weights that Adam passes, each step on the whole batch.

        First weights are uniform within one over the root of a node's inputs (Glorot and Bengio 2010).
        """
        inputs = batch.inputs.shape[2]
        spread = np.full(weight_count(inputs, self.nodes), 1.0 / math.sqrt(inputs + self.nodes))
        spread[-self.nodes - 1 :] = 1.0 / math.sqrt(self.nodes)
        start = spread * np.random.default_rng(self.seed).uniform(-1.0, 1.0, len(spread))
        weights = torch.from_numpy(start.copy()).requires_grad_()
        best, position = math.inf, start
        steps = max(1, self.evaluations // GRADIENT_EVALUATIONS)

        def losses() -> Iterator[tuple[float, torch.Tensor]]:
            nonlocal best, position
            for step in range(steps):
                value = self._cost(weights, batch)
                if value.item() < best:
                    best, position = value.item(), weights.detach().numpy().copy()
                yield step / steps, value

        minimise([weights], losses(), self.build.number("learning_rate"))
        return position


def weight_count(inputs: int, nodes: int) -> int:
    return nodes * (inputs + nodes + 2) + 1


def network_outputs(weights: torch.Tensor, nodes: int, feedback: float, rows: torch.Tensor) -> torch.Tensor:
    """Return the output at each step, shape ``(steps, sequences)``, for rows ``(steps, sequences, k)``, from rest."""
    inputs = rows.shape[2]
    of_inputs, of_context, bias, head, last = weights.split([inputs * nodes, nodes * nodes, nodes, nodes, 1])
    driven = (rows @ of_inputs.view(inputs, nodes) + bias).unbind()
    recurrent = of_context.view(nodes, nodes)
    hidden = context = torch.zeros_like(driven[0])
    states = []
    for row in driven:
        context = torch.add(hidden, context, alpha=feedback)
        hidden = torch.addmm(row, context, recurrent).tanh()
        states.append(hidden)
    return torch.stack(states) @ head + last


_SPACE: Space = {"nodes": (Int(6, 12), 8), "feedback": (Float(0.0, 0.9), 0.3)}
_CHOSEN = (
    "8 hidden nodes; self-feedback of the context; inputs: velocity (straight and softly limited), side of the last "
    "motion, the task's other columns; corrects the force balance where raw pressures are there; rounded absolute "
    "error; 64 pieces of 250 steps"
)

MODELS = (
    RegisteredModel(
        name="pan_elman",
        title="Elman network by swarm and simplex",
        family="related work",
        source="Pan et al. 2017",
        build=partial(Elman, "swarm"),
        space={**_SPACE, "bound": (Float(0.2, 2.0, log=True), 0.4)},
        chosen=f"{_CHOSEN}; 6 x 6 agents, steps of at most 5 % of the box, 30 % of the budget for the simplex; effort "
        "cuts the evaluations of the network (16,000)",
    ),
    RegisteredModel(
        name="elman_adam",
        title="The same Elman network by Adam",
        family="related work",
        source="Pan et al. 2017 (network), Kingma and Ba 2015 (training)",
        build=partial(Elman, "adam"),
        space={**_SPACE, "learning_rate": (Float(3e-3, 6e-2, log=True), 2e-2)},
        chosen=f"{_CHOSEN}; the swarm's rows and number of evaluations of the network, a gradient counted as three; "
        "effort cuts them (16,000)",
    ),
)
