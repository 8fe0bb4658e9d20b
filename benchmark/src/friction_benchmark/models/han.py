"""Friction by a deep network on windows of velocity, trained on synthetic LuGre friction, after Han et al. 2023.

Source: Han et al. 2023, a deep network for friction of hydraulic actuators, trained on synthetic data of LuGre. The
paper was not at hand; that it learns from LuGre, and how well it does if LuGre is not like the actuator, is known from
its citations. What is left open is chosen here and described in ``HanEstimator``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from scipy.signal import savgol_filter

from cylinder_friction.estimators.front_end import fit_front_end
from cylinder_friction.friction_models.lugre import LuGre, LugreParameters, passive_damping_velocity
from friction_benchmark.models.perceptron import Perceptron, PerceptronEstimator, new_perceptron, train_perceptron
from friction_benchmark.models.related_work import last_motion, places_of, task_columns
from friction_benchmark.models.velocity_window import WINDOW_INPUTS, WindowState, advance_window, new_window

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from cylinder_friction.arrays import Array
    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.estimators.training_plan import SequenceData
    from cylinder_friction.recordings.recording import Recording
    from friction_benchmark.models.learned import LearnedState

    Single = NDArray[np.float32]

MOTION = ("position_m",)
VARIANTS = 8
"""Synthetic friction signals along each recording's motion."""

OTHERS = 0.5
"""Standard deviation of the first weights of the task's other columns."""

MOTION_INPUTS = WINDOW_INPUTS + 1
RIDGE = 1e-3

BREAKAWAY_PA = 1.2e5
"""Pressure on the piston at which an unloaded cylinder breaks away: geometric mean of 0.5 and 3 bar."""

STATIC_RATIO, RETRACT_RATIO = 1.5, 1.2
STRIBECK_VELOCITY_M_S = 8e-3
STRIBECK_EXPONENT = 1.5
BRISTLE_STIFFNESS_N_M = 1e7
VISCOUS_N_S_M = 1100.0
DAMPING_RATIO = 0.5
"""Typical values for cylinders of a few centimetres' bore: the middle of the usual range, geometric over decades."""

MOTION_WINDOW, MOTION_ORDER = 31, 3
REST_M_S = 1.5e-3
"""Slower counts as rest: four times the noise of the smoothed velocity of a 12-bit potentiometer."""


@dataclass(frozen=True)
class HanPlan:
    """How the network is built and trained: first on synthetic friction, then, if fine-tuned, on labels.

    Attributes:
        fine_tuned: Whether it is trained on the recordings' labels too.
        layers: Hidden layers, 3 or 4 in the source's class of networks.
        nodes: In each layer, 64 to 128.
        spread: Of the synthetic parameters about their middle, as a share.
        synthetic_steps, learning_rate: Batches of synthetic friction, and the learning rate there.
        tuning_steps, tuning_rate: The same on labels.

    Raises:
        ValueError: A number is impossible.
    """

    fine_tuned: bool = False
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
    """A rectified network on a window of velocity, trained on LuGre friction alone or fine-tuned on labels.

    Chosen where the source leaves it open: 3 layers of 64; a window of 7.2 s whose spans grow with age, each mean
    velocity as it is and softly limited, and the direction of the last motion, which outlives a long rest; each LuGre
    parameter drawn within 40 % of the middle of what is usual for cylinders (``generic_parameters``), along the
    training recordings' motion; mean absolute error, Adam. Without fine-tuning it sees the position alone, whatever
    the task provides. Fine-tuned, the task's other columns join the first layer, raw pressures give a force balance
    that it corrects, the head is fitted anew by ridge regression, and then all layers by Adam. Where it corrects the
    force balance it steps at every sample, else every 20 ms.
    """

    kind: ClassVar[str] = "han"
    plan_type: ClassVar[type] = HanPlan

    def fit(self, recordings: Sequence[Recording]) -> Self:
        """Train on synthetic friction along the recordings' motion and, if fine-tuned, on their labels afterwards."""
        self._begin_fit(recordings)
        self._set_features(fit_front_end("full", self.cylinder, recordings, MOTION))
        self.target_mean_n, self.target_scale_n = 0.0, generic_parameters(self.cylinder).coulomb_n
        self.network = self._learn_synthetic(recordings)
        return super().fit(recordings) if self.plan.fine_tuned else self

    def learn(self, train: Sequence[SequenceData]) -> None:
        """Fine-tune the network on labels: the head by ridge regression, then all layers."""
        assert self.network is not None
        inputs = [self._inputs(self.new_memory(), each.features) for each in train]
        chosen = [stepped & each.usable for (_, stepped), each in zip(inputs, train, strict=True)]
        rows = np.concatenate([seen[mask] for (seen, _), mask in zip(inputs, chosen, strict=True)])
        targets = np.concatenate([each.target[mask] for each, mask in zip(train, chosen, strict=True)])
        shape = (rows.shape[1] - MOTION_INPUTS, self.plan.nodes)
        others = OTHERS * np.random.default_rng([self.seed, 4]).normal(size=shape).astype(np.float32)
        kernels, biases = list(self.network.kernels), list(self.network.biases)
        kernels[0] = np.vstack([kernels[0], others])
        hidden = rows
        for kernel, bias in zip(kernels[:-1], biases[:-1], strict=True):
            hidden = np.maximum(hidden @ kernel + bias, np.float32(0.0))
        design = np.column_stack([hidden.astype(np.float64), np.ones(len(hidden))])
        penalty = RIDGE * len(hidden) * np.eye(design.shape[1])
        head = np.linalg.solve(design.T @ design + penalty, design.T @ targets).astype(np.float32)
        kernels[-1], biases[-1] = head[:-1, None].copy(), head[-1:].copy()
        start = Perceptron(tuple(kernels), tuple(biases), "relu")
        self.network = train_perceptron(start, rows, targets, self.plan.tuning_steps, self.plan.tuning_rate, self.seed)

    def new_memory(self) -> HanMemory:
        return HanMemory(new_window(), np.zeros(1, dtype=np.float32))

    def predict(self, memory: HanMemory, features: Single) -> NDArray[Any]:
        assert self.network is not None
        assert self.features is not None
        rows, stepped = self._inputs(memory, features)
        if self.features.has_base:
            return self.network.run(rows)
        return _hold(self.network.run(rows[stepped]), stepped, memory.held)

    def advance(self, state: LearnedState, samples: Array) -> Array:
        """Return friction [N], shape ``(n,)``; without fine-tuning it sees the position alone."""
        assert self.features is not None
        places = [self.inputs.index(name) for name in self.features.inputs]
        return super().advance(state, np.ascontiguousarray(samples[:, places]))

    def _inputs(self, memory: HanMemory, features: Single) -> tuple[Single, NDArray[np.bool_]]:
        """Return what the network sees at each sample, and where the window stepped; changes ``memory``."""
        assert self.features is not None
        plan, place = self.features, self.features.names.index("velocity_m_s")
        velocity = features[:, place].astype(np.float64) * plan.scale[place] + plan.mean[place]
        rows, stepped = advance_window(memory.window, velocity)
        direction = last_motion(self.features, features).astype(np.float32)
        others = features[:, places_of(self.features, task_columns(self.features))]
        return np.concatenate([rows, direction[:, None], others], axis=1), stepped

    def _learn_synthetic(self, recordings: Sequence[Recording]) -> Perceptron:
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


def generic_parameters(cylinder: Cylinder) -> LugreParameters:
    """Return the LuGre model of a cylinder of which only dimensions and moving mass are known."""
    static_n = BREAKAWAY_PA * cylinder.piston_area_m2
    stiff = 2.0 * DAMPING_RATIO * math.sqrt(BRISTLE_STIFFNESS_N_M * cylinder.moving_mass_kg)
    damping = max(0.0, stiff - VISCOUS_N_S_M)
    coulomb_n = static_n / STATIC_RATIO
    return LugreParameters(
        coulomb_n=coulomb_n,
        static_n=static_n,
        stribeck_velocity_m_s=STRIBECK_VELOCITY_M_S,
        stribeck_exponent=STRIBECK_EXPONENT,
        viscous_n_s_m=VISCOUS_N_S_M,
        bristle_stiffness_n_m=BRISTLE_STIFFNESS_N_M,
        bristle_damping_n_s_m=damping,
        damping_velocity_m_s=min(STRIBECK_VELOCITY_M_S, passive_damping_velocity(coulomb_n, damping)),
        retract_ratio=RETRACT_RATIO,
    )


def drawn_parameters(centre: LugreParameters, spread: float, generator: np.random.Generator) -> LugreParameters:
    """Return parameters within ``1 ± spread`` of the centre's; ratios vary in their excess over 1."""

    def factor() -> float:
        return float(generator.uniform(1.0 - spread, 1.0 + spread))

    coulomb_n = centre.coulomb_n * factor()
    return replace(
        centre,
        coulomb_n=coulomb_n,
        static_n=coulomb_n * (1.0 + (centre.static_n / centre.coulomb_n - 1.0) * factor()),
        stribeck_velocity_m_s=centre.stribeck_velocity_m_s * factor(),
        viscous_n_s_m=centre.viscous_n_s_m * factor(),
        bristle_stiffness_n_m=centre.bristle_stiffness_n_m * factor(),
        retract_ratio=1.0 + (centre.retract_ratio - 1.0) * factor(),
    )


def smooth_velocity(recording: Recording) -> Array:
    """Return a recording's velocity without delay [m/s], zero at rest, shape ``(n,)``; from its position alone."""
    position = recording.column("position_m")
    velocity = savgol_filter(position, MOTION_WINDOW, MOTION_ORDER, deriv=1, delta=recording.sample_time_s)
    return np.where(np.abs(velocity) < REST_M_S, 0.0, velocity)


def synthetic_friction(parameters: LugreParameters, velocity_m_s: Array, sample_time_s: float) -> Array:
    """Return LuGre friction [N] along a motion, shape ``(n,)``."""
    model = LuGre()
    return model.simulate(parameters.packed(), velocity_m_s, sample_time_s, model.new_state())
