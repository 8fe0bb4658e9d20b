"""Friction by an Elman network trained by a swarm and a simplex, and the same network trained by Adam.

Source: Pan et al. 2017, Advances in Mechanical Engineering, doi 10.1177/1687814017744473. Only its abstract was at
hand: Elman network; multi-agent particle swarm, then Nelder and Mead's downhill simplex; better than LuGre at low
speed. What the abstract does not give is chosen here and described in ``ElmanEstimator``.

``x_c(k) = x(k-1) + a x_c(k-1)``, ``x(k) = tanh(u(k) W_u + x_c(k) W_c + b)``, ``y(k) = x(k) w + b_o``: Elman 1990 with
the context's self-feedback a of Pham and Liu 1992. All weights lie in one vector, in the order W_u, W_c, b, w, b_o.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self

import numba
import numpy as np

from cylinder_friction.realtime.lstm import tanh
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from friction_benchmark.models.learned import LearnedEstimator
from friction_benchmark.models.related_work import (
    VELOCITIES,
    last_motion,
    places_of,
    smoothed_absolute,
    task_columns,
)
from friction_benchmark.models.swarm import Found, SwarmPlan, swarm_then_simplex

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    import torch
    from numpy.typing import NDArray

    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.estimators.training_plan import SequenceData

    Single = NDArray[np.float32]

Trainer = Literal["swarm", "adam"]
STRIDE = 4
"""Samples between two steps of the network, 20 ms at 200 Hz, where friction itself is its output, held between.

Where it corrects a force balance it steps at every sample: a correction of noise that has passed would be noise.
"""

SEGMENTS, SEGMENT_STEPS, BURN_IN = 64, 250, 25
"""Pieces of the training recordings used for training, their length, and the steps before the first scored one."""

GRADIENT_EVALUATIONS = 3
"""What one gradient costs in evaluations of the network: one forward, and backward at about twice its operations."""


@dataclass(frozen=True)
class ElmanPlan:
    """How the network is built and trained.

    Attributes:
        nodes: Hidden nodes, and as many context nodes.
        feedback: Of the context to itself, in [0, 1).
        trainer: ``swarm``, with the simplex after it, or ``adam``.
        evaluations: Of the network over all training rows, at most; a gradient counts as three.
        bound: Half side of the box of weights that the swarm stays in.
        learning_rate: Of Adam, falling with a cosine.

    Raises:
        ValueError: The feedback or a number of nodes or evaluations is impossible.
    """

    nodes: int = 8
    feedback: float = 0.3
    trainer: Trainer = "swarm"
    evaluations: int = 16_000
    bound: float = 0.4
    learning_rate: float = 2e-2

    def __post_init__(self) -> None:
        if self.nodes < 1 or not 0.0 <= self.feedback < 1.0 or self.evaluations < 1:
            raise ValueError(f"expected nodes and evaluations of at least 1 and feedback in [0, 1), but got {self}")


@dataclass
class ElmanMemory:
    """Hidden and context nodes, each shape ``(nodes,)``, and ``(samples until the next step, last output)``."""

    hidden: Single
    context: Single
    held: NDArray[np.float64]


@dataclass(frozen=True)
class Batch:
    """Sequences side by side, all of one length: inputs ``(steps, sequences, k)``, target and weight ``(steps,
    sequences)``; the weight is 1 where a step is scored, else 0."""

    inputs: torch.Tensor
    target: torch.Tensor
    weight: torch.Tensor


class ElmanEstimator(LearnedEstimator):
    """An Elman network on velocity and the task's other columns; gives friction or corrects the force balance.

    Chosen where the source leaves it open: 8 hidden nodes; context self-feedback; inputs are the velocity, as it is and
    softly limited, the direction of the last motion and the task's other columns; the network corrects the force
    balance where raw pressures are available; the cost is the absolute error, rounded at zero, over 64 pieces of 250
    steps; the swarm's box.

    Attributes:
        weights: All of them, float32, in the order of the module's equations; None before ``fit``.
        found: How the search went; None for a loaded estimator.
    """

    kind: ClassVar[str] = "elman"

    def __init__(
        self,
        cylinder: Cylinder,
        inputs: Sequence[str] = SAMPLE_COLUMNS,
        plan: ElmanPlan | None = None,
        seed: int = 0,
    ) -> None:
        super().__init__(cylinder, inputs, seed)
        self.plan = plan or ElmanPlan()
        self.weights: Single | None = None
        self.found: Found | None = None

    def learn(self, train: Sequence[SequenceData]) -> None:
        from cylinder_friction.estimators.training import reproducible  # PyTorch: only training needs it

        with reproducible(self.seed):
            train_weights = _train_with_swarm if self.plan.trainer == "swarm" else _train_with_adam
            self.found = train_weights(self._batch(train), self.plan, self.seed)
        self.weights = self.found.position.astype(np.float32)

    def new_memory(self) -> ElmanMemory:
        nodes = self.plan.nodes
        return ElmanMemory(np.zeros(nodes, np.float32), np.zeros(nodes, np.float32), np.zeros(2))

    def predict(self, memory: ElmanMemory, features: Single) -> NDArray[Any]:
        assert self.weights is not None
        rows, feedback = self._inputs(features), np.float32(self.plan.feedback)
        return elman_outputs(self.weights, feedback, rows, memory.hidden, memory.context, memory.held, self._stride())

    def model_multiply_adds(self) -> int:
        """Return those of one step of the network, biases included, which comes every fourth sample: the worst case."""
        return weight_count(len(self._columns()) + 1, self.plan.nodes)

    def write_model(self, folder: Path) -> dict[str, Any]:  # noqa: ARG002 - some hundred numbers are JSON
        assert self.weights is not None
        return {"plan": vars(self.plan), "seed": self.seed, "weights": self.weights.tolist()}

    @classmethod
    def read_model(cls, folder: Path, content: dict[str, Any], cylinder: Cylinder, inputs: Sequence[str]) -> Self:  # noqa: ARG003
        estimator = cls(cylinder, inputs, ElmanPlan(**content["plan"]), content["seed"])
        estimator.weights = np.array(content["weights"], dtype=np.float32)
        return estimator

    def _columns(self) -> list[int]:
        assert self.features is not None
        return places_of(self.features, (*VELOCITIES, *task_columns(self.features)))

    def _inputs(self, features: Single) -> Single:
        """Return what the network sees, shape ``(n, k)``."""
        assert self.features is not None
        direction = last_motion(self.features, features)
        return np.column_stack([features[:, self._columns()], direction]).astype(np.float32)

    def _stride(self) -> int:
        assert self.features is not None
        return 1 if self.features.has_base else STRIDE

    def _batch(self, recordings: Sequence[SequenceData]) -> Batch:
        """Return pieces from places drawn at random, as many of each recording as of the others."""
        import torch

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


def weight_count(inputs: int, nodes: int) -> int:
    """Return how many weights a network with so many inputs has."""
    return nodes * (inputs + nodes + 2) + 1


def mean_cost(weights: torch.Tensor, nodes: int, feedback: float, batch: Batch) -> torch.Tensor:
    """Return the mean cost over the scored steps, differentiable by the weights; hidden nodes start at zero."""
    import torch

    inputs = batch.inputs.shape[2]
    of_inputs, of_context, bias, head, last = weights.split([inputs * nodes, nodes * nodes, nodes, nodes, 1])
    driven = (batch.inputs @ of_inputs.view(inputs, nodes) + bias).unbind()
    recurrent = of_context.view(nodes, nodes)
    hidden = context = torch.zeros_like(driven[0])
    states = []
    for row in driven:
        context = torch.add(hidden, context, alpha=feedback)
        hidden = torch.addmm(row, context, recurrent).tanh()
        states.append(hidden)
    error = torch.stack(states) @ head + last - batch.target
    return (smoothed_absolute(error) * batch.weight).sum() / batch.weight.sum()


def _train_with_swarm(batch: Batch, plan: ElmanPlan, seed: int) -> Found:
    import torch

    corner = np.full(weight_count(batch.inputs.shape[2], plan.nodes), plan.bound)
    budget = max(plan.evaluations, SwarmPlan().side ** 2)
    with torch.inference_mode():
        return swarm_then_simplex(
            lambda position: mean_cost(torch.from_numpy(position), plan.nodes, plan.feedback, batch).item(),
            -corner,
            corner,
            budget,
            seed,
        )


def _train_with_adam(batch: Batch, plan: ElmanPlan, seed: int) -> Found:
    """Return the best weights that Adam (Kingma and Ba 2015) passes, each step on the whole batch.

    First weights are uniform within one over the root of a node's inputs (Glorot and Bengio 2010); the gradient is
    clipped at norm 1.
    """
    import torch

    inputs, nodes = batch.inputs.shape[2], plan.nodes
    spread = np.full(weight_count(inputs, nodes), 1.0 / math.sqrt(inputs + nodes))
    spread[-nodes - 1 :] = 1.0 / math.sqrt(nodes)
    start = spread * np.random.default_rng(seed).uniform(-1.0, 1.0, len(spread))
    weights = torch.from_numpy(start).requires_grad_()
    steps = max(1, plan.evaluations // GRADIENT_EVALUATIONS)
    optimiser = torch.optim.Adam([weights], lr=plan.learning_rate)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    best, position = math.inf, start
    for _ in range(steps):
        optimiser.zero_grad()
        value = mean_cost(weights, nodes, plan.feedback, batch)
        if value.item() < best:
            best, position = value.item(), weights.detach().numpy().copy()
        torch.autograd.backward(value)
        torch.nn.utils.clip_grad_norm_([weights], 1.0)
        optimiser.step()
        schedule.step()
    return Found(position, best, GRADIENT_EVALUATIONS * steps)


@numba.njit(cache=True)
def elman_outputs(
    weights: Single,
    feedback: np.float32,
    rows: Single,
    hidden: Single,
    context: Single,
    held: NDArray[np.float64],
    stride: int,
) -> NDArray[np.float64]:
    """Return the output at each row, shape ``(n,)``, held between steps; changes ``hidden``, ``context``, ``held``."""
    nodes, inputs = hidden.shape[0], rows.shape[1]
    recurrent = inputs * nodes
    bias = recurrent + nodes * nodes
    result = np.empty(rows.shape[0])
    for row in range(rows.shape[0]):
        if held[0] == 0.0:
            held[0] = stride
            output = weights[bias + 2 * nodes]
            for node in range(nodes):
                context[node] = hidden[node] + feedback * context[node]
            for node in range(nodes):
                total = weights[bias + node]
                for index in range(inputs):
                    total += rows[row, index] * weights[index * nodes + node]
                for index in range(nodes):
                    total += context[index] * weights[recurrent + index * nodes + node]
                hidden[node] = tanh(total)
                output += hidden[node] * weights[bias + nodes + node]
            held[1] = output
        held[0] -= 1.0
        result[row] = held[1]
    return result
