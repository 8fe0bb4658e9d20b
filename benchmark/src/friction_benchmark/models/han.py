"""Friction by a deep network on windows of velocity, trained on synthetic LuGre friction, after Han et al. 2023.

The paper was not at hand; that its network learns from LuGre, and how well it does if the actuator is not like it, is
known from its citations. The models' ``chosen`` states what was taken where they leave something open.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Self

import numpy as np
import torch
from scipy.signal import savgol_filter
from torch import nn

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.training import reproducible
from cylinder_friction.estimators.training_plan import SequenceData
from cylinder_friction.friction_models.lugre import LuGre, LugreParameters, passive_damping_velocity
from cylinder_friction.recordings.recording import Recording
from friction_benchmark.models.base import Single
from friction_benchmark.models.related_work import MotionModel
from friction_benchmark.models.training import minimise, outputs, perceptron, weights_in
from friction_benchmark.models.velocity_window import EVERY, WINDOW_INPUTS, windows
from friction_benchmark.registry import BuildConfiguration, Float, OneOf, RegisteredModel, Space

VARIANTS = 8  # Synthetic friction signals along each recording's motion
OTHERS = 0.5  # Standard deviation of the first weights of the task's other columns
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
REST_M_S = 1.5e-3  # Slower counts as rest: four times the noise of the smoothed velocity of a 12-bit potentiometer
NODES, BATCH = 64, 1024


class Han(MotionModel):
    """A rectified network on a window of velocity, trained on LuGre friction alone or fine-tuned on labels.

    Without fine-tuning it sees the position alone, whatever the task provides. Fine-tuned, the other columns join
    the first layer, and the head is fitted anew by ridge regression before all layers are trained. Where it corrects
    the force balance it steps at every sample, else every 20 ms. Effort cuts the batches.
    """

    def __init__(self, fine_tuned: bool, build: BuildConfiguration) -> None:
        super().__init__(build)
        self.fine_tuned = fine_tuned

    def fit(self, recordings: Sequence[Recording]) -> Self:
        """Train on synthetic friction along the recordings' motion and, if fine-tuned, on their labels afterwards."""
        self.set_features(recordings, ("position_m",))
        self.target_mean_n, self.target_scale_n = 0.0, generic_parameters(self.cylinder).coulomb_n
        self._learn_synthetic(recordings)
        return super().fit(recordings) if self.fine_tuned else self

    def learn(self, train: Sequence[SequenceData]) -> None:
        """Fine-tune the network on labels: the head by ridge regression, then all layers."""
        masks = [each.usable[::EVERY] for each in train]
        rows = np.concatenate([self._inputs(each.features)[::EVERY][m] for each, m in zip(train, masks, strict=True)])
        targets = np.concatenate([each.target[::EVERY][mask] for each, mask in zip(train, masks, strict=True)])
        self._widen(rows.shape[1] - MOTION_INPUTS)
        with torch.inference_mode():
            hidden = self.network[:-1](torch.from_numpy(rows)).numpy()
        design = np.column_stack([hidden.astype(np.float64), np.ones(len(hidden))])
        penalty = RIDGE * len(hidden) * np.eye(design.shape[1])
        head = np.linalg.solve(design.T @ design + penalty, design.T @ targets).astype(np.float32)
        last = self.network[-1]
        last.load_state_dict({"weight": torch.from_numpy(head[None, :-1]), "bias": torch.from_numpy(head[-1:])})
        self._train(rows, targets[:, None], self.build.share(4_000), "tuning_rate", 4e-3)

    def predict(self, features: Single) -> Single:
        rows = self._inputs(features)
        if self.features.has_base:
            return outputs(self.network, rows)
        return np.repeat(outputs(self.network, rows[::EVERY]), EVERY)[: len(features)]

    def model_multiply_adds(self) -> int:
        """Return those of one step of the network: the worst case if it does not step at every sample."""
        return weights_in(self.network)

    def _inputs(self, features: Single) -> Single:
        """Return what the network sees at each sample; the window steps at every ``EVERY``-th."""
        seen = np.repeat(windows(self.column(features, "velocity_m_s")), EVERY, axis=0)[: len(features)]
        direction = self.last_motion(features).astype(np.float32)
        return np.column_stack([seen, direction, self.others(features)])

    def _learn_synthetic(self, recordings: Sequence[Recording]) -> None:
        centre, spread = generic_parameters(self.cylinder), self.build.number("spread")
        generator = np.random.default_rng([self.seed, 3])
        rows, targets = [], []
        for recording in recordings:
            velocity, step_s = smooth_velocity(recording), recording.sample_time_s
            drawn = [drawn_parameters(centre, spread, generator) for _ in range(VARIANTS)]
            friction = [synthetic_friction(parameters, velocity, step_s) for parameters in drawn]
            rows.append(self._inputs(self.features_of(recording)[0])[::EVERY])
            targets.append(np.stack(friction, axis=1)[::EVERY] / self.target_scale_n)
        with reproducible(self.seed):
            self.network = perceptron(MOTION_INPUTS, [NODES] * self.build.whole("layers"), nn.ReLU)
        synthetic = np.concatenate(targets).astype(np.float32)
        self._train(np.concatenate(rows), synthetic, self.build.share(2_000), "learning_rate", 3e-3)

    def _widen(self, others: int) -> None:
        """Let the first layer take so many further columns, with small random weights."""
        first = self.network[0]
        assert isinstance(first, nn.Linear)
        drawn = OTHERS * np.random.default_rng([self.seed, 4]).normal(size=(NODES, others)).astype(np.float32)
        wider = nn.Linear(MOTION_INPUTS + others, NODES)
        weight = torch.cat([first.weight.detach(), torch.from_numpy(drawn)], dim=1)
        wider.load_state_dict({"weight": weight, "bias": first.bias.detach()})
        self.network[0] = wider

    def _train(self, rows: Single, targets: Single, steps: int, rate: str, usual_rate: float) -> None:
        """Train on the mean absolute error; each row of a batch draws one of its targets, shape ``(n, variants)``."""
        generator = np.random.default_rng([self.seed, 2])

        def losses() -> Iterator[tuple[float, torch.Tensor]]:
            for step in range(steps):
                drawn = generator.integers(len(rows), size=BATCH)
                target = torch.from_numpy(targets[drawn, generator.integers(targets.shape[1], size=BATCH)])
                yield step / steps, (self.network(torch.from_numpy(rows[drawn]))[:, 0] - target).abs().mean()

        with reproducible(self.seed):
            learning_rate = float(self.build.hyperparameters.get(rate, usual_rate))
            minimise(self.network.parameters(), losses(), learning_rate)


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
    """Return the velocity without delay [m/s], zero at rest, shape ``(n,)``; from the position alone."""
    position = recording.column("position_m")
    velocity = savgol_filter(position, MOTION_WINDOW, MOTION_ORDER, deriv=1, delta=recording.sample_time_s)
    return np.where(np.abs(velocity) < REST_M_S, 0.0, velocity)


def synthetic_friction(parameters: LugreParameters, velocity_m_s: Array, sample_time_s: float) -> Array:
    """Return LuGre friction [N] along a motion, shape ``(n,)``."""
    model = LuGre()
    return model.simulate(parameters.packed(), velocity_m_s, sample_time_s, model.new_state())


_SPACE: Space = {"layers": (OneOf((3, 4)), 3), "spread": (Float(0.3, 0.5), 0.4)}
_CHOSEN = (
    "3 or 4 rectified layers of 64; a 7.2 s window whose spans grow with age, and the side of the last motion; LuGre "
    "parameters drawn 30 to 50 % around handbook middles (breakaway 1.2 bar on the piston, static 1.5 times Coulomb, "
    "Stribeck velocity 8 mm/s, 1100 N s/m, 10 N/µm), along the training recordings' motion"
)

MODELS = (
    RegisteredModel(
        name="han_zero_shot",
        title="Deep network trained on LuGre, zero-shot",
        family="related work",
        source="Han et al. 2023",
        build=partial(Han, False),
        space={**_SPACE, "learning_rate": (Float(1e-3, 1e-2, log=True), 3e-3)},
        chosen=f"{_CHOSEN}; sees no label and no column but the position; effort cuts the batches (2000)",
    ),
    RegisteredModel(
        name="han_fine_tuned",
        title="Deep network trained on LuGre, fine-tuned",
        family="related work",
        source="Han et al. 2023",
        build=partial(Han, True),
        space={**_SPACE, "tuning_rate": (Float(5e-4, 1e-2, log=True), 4e-3)},
        chosen=f"{_CHOSEN}; then on the task's labels: head by ridge regression, all layers by Adam; the task's other "
        "columns join the first layer; corrects the force balance where raw pressures are there; effort cuts the "
        "batches (6000)",
    ),
)
