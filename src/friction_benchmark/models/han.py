"""Friction by a deep network on windows of velocity that synthetic LuGre friction taught, after Han et al. 2023.

Source: Han et al. 2023, a deep network for friction of hydraulic actuators, trained on synthetic data of LuGre. The
paper was not at hand; that it learns from LuGre, and how well it does if LuGre is not like the actuator, is known from
its citations. What is left open is chosen here and said in ``HanEstimator``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from cylinder_friction.estimators.features import fit_features
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from friction_benchmark.models.perceptron import Perceptron
from friction_benchmark.models.perceptron_estimator import PerceptronEstimator
from friction_benchmark.models.source_columns import last_motion, places_of, task_columns
from friction_benchmark.models.synthetic_friction import (
    drawn_parameters,
    generic_parameters,
    smooth_velocity,
    synthetic_friction,
)
from friction_benchmark.models.velocity_window import WINDOW_INPUTS, WindowState, advance_window, new_window

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.estimators.base import Array
    from cylinder_friction.estimators.training_plan import SequenceData
    from cylinder_friction.recordings.recording import Recording
    from friction_benchmark.models.learned import LearnedState

    Single = NDArray[np.float32]

MOTION = ("position_m",)
VARIANTS = 8
"""Synthetic frictions along each recording's motion."""

OTHERS = 0.5
"""Standard deviation of the first weights of the task's other columns."""

MOTION_INPUTS = WINDOW_INPUTS + 1
RIDGE = 1e-3


@dataclass(frozen=True)
class HanPlan:
    """How the network is made and trained.

    Attributes:
        fine_tuned: Whether it goes on learning from the recordings' labels.
        layers: Hidden layers, 3 or 4 in the source's class of networks.
        nodes: In each, 64 to 128.
        spread: Of the synthetic parameters about their middle, as a share.
        synthetic_steps: Batches of synthetic friction.
        tuning_steps: Batches of labels.
        learning_rate: On synthetic friction.
        tuning_rate: On labels.

    Raises:
        ValueError: A number is impossible.
    """

    fine_tuned: bool
    layers: int = 3
    nodes: int = 64
    spread: float = 0.4
    synthetic_steps: int = 2_000
    tuning_steps: int = 4_000
    learning_rate: float = 3e-3
    tuning_rate: float = 4e-3

    def __post_init__(self) -> None:
        if min(self.layers, self.nodes, self.synthetic_steps, self.tuning_steps) < 1 or not 0.0 <= self.spread < 1.0:
            raise ValueError(f"expected layers, nodes and steps of at least 1 and a spread in [0, 1), but got {self}")


@dataclass
class HanMemory:
    """State of the window, and the last output, shape ``(1,)``."""

    window: WindowState
    held: Single


class HanEstimator(PerceptronEstimator[HanPlan]):
    """A rectified network on a window of velocity, taught by LuGre; untouched by labels, or fine-tuned on them.

    Chosen where the source says nothing: 3 layers of 64; a window of 7.2 s whose spans grow with age, each mean
    velocity straight and softly limited, and the direction of the last motion, which outlives a long rest; each LuGre
    parameter drawn within 40 % of the middle of what is usual for cylinders (``synthetic_friction``), along the
    training recordings' motion; mean absolute error, Adam. Untouched by labels it sees the position alone, whatever
    the task shows. Fine-tuned, the task's other columns join the first layer, raw pressures give a force balance that
    it corrects, the head is fitted anew by ridge regression, and then all layers by Adam. Where it corrects it answers
    at every sample, else every 20 ms.

    Args:
        cylinder: Its areas and moving mass, which the synthetic friction follows.
        inputs: Columns that it is given.
        plan: Of network and training.
        seed: Of synthetic friction, first weights and batches.

    Attributes:
        network: None before ``fit``.
    """

    kind: ClassVar[str] = "han"
    plan_type: ClassVar[type] = HanPlan

    def __init__(
        self,
        cylinder: Cylinder,
        inputs: Sequence[str] = SAMPLE_COLUMNS,
        plan: HanPlan | None = None,
        seed: int = 0,
    ) -> None:
        super().__init__(cylinder, inputs, plan or HanPlan(fine_tuned=False), seed)
        self._taught: Perceptron | None = None

    def fit(self, recordings: Sequence[Recording]) -> Self:
        """Learn from synthetic friction along the motion of the recordings and, if fine-tuned, then from labels."""
        self._begin_fit(recordings)
        self._set_features(fit_features(MOTION, self.cylinder, recordings))
        self.target_mean_n, self.target_scale_n = 0.0, generic_parameters(self.cylinder).coulomb_n
        self._taught = self._learn_synthetic(recordings)
        if self.plan.fine_tuned:
            return super().fit(recordings)
        self._use(self._taught)
        return self

    def learn(self, train: Sequence[SequenceData]) -> None:
        from friction_benchmark.models.perceptron_training import last_hidden, train_perceptron

        assert self._taught is not None
        rows, targets = self._labelled(train)
        shape = (rows.shape[1] - MOTION_INPUTS, self.plan.nodes)
        others = OTHERS * np.random.default_rng([self.seed, 4]).normal(size=shape)
        first = np.vstack([self._taught.kernels[0], others])
        start = Perceptron((first.astype(np.float32), *self._taught.kernels[1:]), self._taught.biases, "relu")
        hidden = last_hidden(start, rows).astype(np.float64)
        design = np.column_stack([hidden, np.ones(len(hidden))])
        penalty = RIDGE * len(hidden) * np.eye(design.shape[1])
        head = np.linalg.solve(design.T @ design + penalty, design.T @ targets).astype(np.float32)
        start = Perceptron(
            (*start.kernels[:-1], head[:-1, None].copy()), (*start.biases[:-1], head[-1:].copy()), "relu"
        )
        plan = self.plan
        self._use(train_perceptron(start, rows, targets, plan.tuning_steps, plan.tuning_rate, self.seed))

    def new_memory(self) -> HanMemory:
        return HanMemory(new_window(), np.zeros(1, dtype=np.float32))

    def predict(self, memory: HanMemory, features: Single) -> NDArray[Any]:
        assert self._runner is not None
        assert self.features is not None
        rows, stepped = self._inputs(memory, features)
        if self.features.has_base:
            return self._runner.run(rows)
        return _hold(self._runner.run(rows[stepped]), stepped, memory.held)

    def advance(self, state: LearnedState, samples: Array) -> Array:
        return super().advance(state, self._seen(samples))

    def _seen(self, samples: Array) -> Array:
        """Return the columns that its features are made from: the position alone without fine tuning."""
        assert self.features is not None
        places = [self.inputs.index(name) for name in self.features.inputs]
        return np.ascontiguousarray(samples[:, places])

    def _inputs(self, memory: HanMemory, features: Single) -> tuple[Single, NDArray[np.bool_]]:
        """Return what the network sees at each sample, and where the window stepped; changes ``memory``."""
        assert self.features is not None
        plan, place = self.features.front_end, self.features.names.index("velocity_m_s")
        velocity = features[:, place].astype(np.float64) * plan.scale[place] + plan.mean[place]
        rows, stepped = advance_window(memory.window, velocity)
        way = last_motion(self.features, features).astype(np.float32)
        others = features[:, places_of(self.features, task_columns(self.features))]
        return np.concatenate([rows, way[:, None], others], axis=1), stepped

    def _labelled(self, recordings: Sequence[SequenceData]) -> tuple[Single, Single]:
        """Return rows and targets at every step of the window that may be used."""
        rows, targets = [], []
        for each in recordings:
            seen, stepped = self._inputs(self.new_memory(), each.features)
            chosen = stepped & each.usable
            rows.append(seen[chosen])
            targets.append(each.target[chosen])
        return np.concatenate(rows), np.concatenate(targets)

    def _learn_synthetic(self, recordings: Sequence[Recording]) -> Perceptron:
        from friction_benchmark.models.perceptron_training import new_perceptron, train_perceptron

        assert self._block is not None
        plan, centre = self.plan, generic_parameters(self.cylinder)
        generator = np.random.default_rng([self.seed, 3])
        rows, targets = [], []
        for recording in recordings:
            features, _ = self._block.advance(self._block.new_state(), recording.samples(MOTION))
            seen, stepped = self._inputs(self.new_memory(), features)
            velocity = smooth_velocity(recording)
            friction = [
                synthetic_friction(drawn_parameters(centre, plan.spread, generator), velocity, recording.sample_time_s)
                for _ in range(VARIANTS)
            ]
            rows.append(seen[stepped])
            targets.append(np.stack(friction, axis=1)[stepped] / self.target_scale_n)
        start = new_perceptron(MOTION_INPUTS, [plan.nodes] * plan.layers, self.seed)
        return train_perceptron(
            start,
            np.concatenate(rows),
            np.concatenate(targets).astype(np.float32),
            plan.synthetic_steps,
            plan.learning_rate,
            self.seed,
        )


def _hold(values: Single, stepped: NDArray[np.bool_], held: Single) -> Single:
    """Return the last value at each sample, shape ``(n,)``; changes ``held``."""
    result = np.concatenate([held, values])[np.cumsum(stepped)]
    if len(result):
        held[0] = result[-1]
    return result
