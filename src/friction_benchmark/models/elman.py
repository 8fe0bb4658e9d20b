"""Friction by an Elman network that a swarm and a simplex train, and the same network trained by Adam.

Source: Pan et al. 2017, Advances in Mechanical Engineering, doi 10.1177/1687814017744473. Its abstract alone was at
hand: Elman network; multi-agent particle swarm, then Nelder and Mead's downhill simplex; better than LuGre at low
speed. What it leaves open is chosen here and said in ``ElmanEstimator``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self

import numba
import numpy as np

from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from friction_benchmark.models.elman_network import Batch, cost, cost_and_gradient, elman_step, weight_count
from friction_benchmark.models.learned import LearnedEstimator
from friction_benchmark.models.source_columns import VELOCITIES, last_motion, places_of, task_columns
from friction_benchmark.models.swarm import TRAIL, Found, SwarmPlan, swarm_then_simplex

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

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
"""Pieces of the training recordings that are learnt from, their length, and the steps before the first scored one."""

GRADIENT_EVALUATIONS = 3
"""What one gradient costs in evaluations of the network: one forward, and backward at about twice its operations."""


@dataclass(frozen=True)
class ElmanPlan:
    """How the network is made and trained.

    Attributes:
        nodes: Hidden nodes, and as many context nodes.
        feedback: Of the context to itself, in [0, 1).
        trainer: ``swarm``, with the simplex after it, or ``adam``.
        evaluations: Of the network over all rows that are learnt from, at most; a gradient counts as three.
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
    """What the network carries from one sample to the next.

    Attributes:
        hidden, context: Shape ``(nodes,)``.
        held: Samples until the next step, and the last output.
    """

    hidden: Single
    context: Single
    held: NDArray[np.float64]


class ElmanEstimator(LearnedEstimator):
    """An Elman network on velocity and what else the task shows, that is friction or corrects the force balance.

    Chosen where the source says nothing: 8 hidden nodes; context self-feedback; inputs are the velocity, straight and
    softly limited, the direction of the last motion and the task's other columns; the network corrects the force
    balance where raw pressures are there; cost is the absolute error, rounded at nought; 64 pieces of 250 steps are
    learnt from; the weights after that twentieth of the search are kept which is best, on validation recordings where
    there are some; the swarm's box.

    Args:
        cylinder: Its areas.
        inputs: Columns that it sees.
        plan: Of network and training.
        seed: Of pieces, swarm and first weights.

    Attributes:
        weights: All of them, float32, in the order of ``elman_network``; None before ``fit``.
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
        batch = self._batch(train)
        plan = self.plan
        count = weight_count(len(self._columns()) + 1, plan.nodes)
        if plan.trainer == "swarm":
            self.found = swarm_then_simplex(
                lambda place: cost(place, plan.nodes, plan.feedback, batch),
                np.full(count, -plan.bound),
                np.full(count, plan.bound),
                max(plan.evaluations, SwarmPlan().side ** 2),
                self.seed,
            )
        else:
            self.found = train_with_adam(batch, plan, self.seed)
        tried = [cost(place, plan.nodes, plan.feedback, batch) for place in self.found.trail]
        self.weights = self.found.trail[int(np.argmin(tried))].astype(np.float32)

    def new_memory(self) -> ElmanMemory:
        nodes = self.plan.nodes
        return ElmanMemory(np.zeros(nodes, np.float32), np.zeros(nodes, np.float32), np.zeros(2))

    def predict(self, memory: ElmanMemory, features: Single) -> NDArray[Any]:
        assert self.weights is not None
        return _run(
            self.weights,
            np.float32(self.plan.feedback),
            self._inputs(features),
            memory.hidden,
            memory.context,
            memory.held,
            self._stride(),
        )

    def model_multiply_adds(self) -> int:
        """Return those of one step of the network, which comes every fourth sample: the worst case."""
        return weight_count(len(self._columns()) + 1, self.plan.nodes)

    def write_model(self, folder: Path) -> dict[str, Any]:  # noqa: ARG002 - some hundred numbers are JSON
        assert self.weights is not None
        return {"plan": vars(self.plan), "seed": self.seed, "weights": self.weights.tolist()}

    @classmethod
    def read_model(
        cls,
        folder: Path,  # noqa: ARG003
        content: dict[str, Any],
        cylinder: Cylinder,
        inputs: Sequence[str],
    ) -> Self:
        estimator = cls(cylinder, inputs, ElmanPlan(**content["plan"]), content["seed"])
        estimator.weights = np.array(content["weights"], dtype=np.float32)
        return estimator

    def _columns(self) -> list[int]:
        assert self.features is not None
        return places_of(self.features, (*VELOCITIES, *task_columns(self.features)))

    def _inputs(self, features: Single) -> Single:
        """Return what the network sees, shape ``(n, k)``."""
        assert self.features is not None
        way = last_motion(self.features, features)
        return np.column_stack([features[:, self._columns()], way]).astype(np.float32)

    def _stride(self) -> int:
        assert self.features is not None
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
        weight = np.stack([usable for _, _, usable in pieces], axis=1).astype(np.float32)
        weight[:BURN_IN] = 0.0
        return Batch(
            np.ascontiguousarray(np.stack([features for features, _, _ in pieces], axis=2), dtype=np.float32),
            np.ascontiguousarray(np.stack([target for _, target, _ in pieces], axis=1)),
            weight,
        )


def train_with_adam(batch: Batch, plan: ElmanPlan, seed: int) -> Found:
    """Return the best weights that Adam (Kingma and Ba 2015) passes, each step on all rows of the batch.

    First weights are uniform within one over the root of a node's inputs (Glorot and Bengio 2010); the gradient is cut
    at norm 1.
    """
    generator = np.random.default_rng(seed)
    width, nodes = batch.inputs.shape[1], plan.nodes
    count = weight_count(width, nodes)
    spread = np.full(count, 1.0 / math.sqrt(width + nodes))
    spread[-nodes - 1 :] = 1.0 / math.sqrt(nodes)
    weights = spread * generator.uniform(-1.0, 1.0, count)
    first, second = np.zeros(count), np.zeros(count)
    best, place = math.inf, weights
    curve: list[float] = []
    trail: list[NDArray[np.float64]] = []
    steps = max(1, plan.evaluations // GRADIENT_EVALUATIONS)
    for step in range(1, steps + 1):
        value, gradient = cost_and_gradient(weights, nodes, plan.feedback, batch)
        if value < best:
            best, place = value, weights.copy()
        curve += [best] * GRADIENT_EVALUATIONS
        if step * TRAIL >= (len(trail) + 1) * steps:
            trail.append(place)
        gradient /= max(1.0, float(np.linalg.norm(gradient)))
        first += 0.1 * (gradient - first)
        second += 0.001 * (gradient**2 - second)
        rate = plan.learning_rate * 0.5 * (1.0 + math.cos(math.pi * step / steps))
        weights = weights - rate * first / (1.0 - 0.9**step) / (np.sqrt(second / (1.0 - 0.999**step)) + 1e-8)
    return Found(place, best, curve, trail)


@numba.njit(cache=True)
def _run(
    weights: Single,
    feedback: np.float32,
    rows: Single,
    hidden: Single,
    context: Single,
    held: NDArray[np.float64],
    stride: int,
) -> NDArray[np.float64]:
    result = np.empty(rows.shape[0])
    for row in range(rows.shape[0]):
        if held[0] == 0.0:
            held[0] = stride
            held[1] = elman_step(weights, feedback, rows[row], hidden, context)
        held[0] -= 1.0
        result[row] = held[1]
    return result
