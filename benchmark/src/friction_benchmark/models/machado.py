"""Friction compensation by a small neural network, after Machado et al. 2006.

The paper, on cascade control of a hydraulic actuator, was not at hand; from its citations: one small network, trained
offline on the output of a model with a variable friction coefficient, its own output fed forward; inputs are the
velocity now and one sample ago and, at standstill, the stiction force. The model's ``chosen`` states what was taken
where they leave it open. A model of the labels, as a target, could only be worse than the labels.
"""

from collections.abc import Sequence

import numpy as np
import torch
from torch import nn

from cylinder_friction.estimators.training import reproducible
from cylinder_friction.estimators.training_plan import SequenceData
from friction_benchmark.models.base import Single
from friction_benchmark.models.related_work import VELOCITIES, MotionModel, smoothed_absolute
from friction_benchmark.models.training import outputs, perceptron, weights_in
from friction_benchmark.registry import BuildConfiguration, Float, Int, OneOf, RegisteredModel

CREEP_M_S = 3e-3
"""Below this speed the stiction force is given: above the noise of the velocity of a 12-bit potentiometer."""
ROWS = 24_000  # Training rows, drawn at random from all usable ones
CHANGE_SCALE = 10.0  # Brings the change of a standardised velocity over some samples to the size of the velocity


class Machado(MotionModel):
    """A perceptron of one hyperbolic layer on two velocities and the stiction force, without memory of its own.

    Velocity also goes through a soft limit. The earlier velocity is given as a difference, which spans the same space
    and is better scaled. All weights are found by L-BFGS (Liu and Nocedal 1989) on the absolute error rounded at zero.
    """

    def __init__(self, build: BuildConfiguration) -> None:
        super().__init__(build)
        self.penalty, self.iterations = build.number("penalty"), build.share(3_200)

    def learn(self, train: Sequence[SequenceData]) -> None:
        inputs = np.concatenate([self._inputs(each.features)[each.usable] for each in train])
        target = np.concatenate([each.target[each.usable] for each in train])
        drawn = np.random.default_rng(self.seed).permutation(len(target))[:ROWS]
        seen, wanted = (torch.from_numpy(part[drawn].astype(np.float64)) for part in (inputs, target))
        with reproducible(self.seed):
            self.network = perceptron(inputs.shape[1], [self.build.whole("nodes")], nn.Tanh).double()
            weights = list(self.network.parameters())
            count = sum(each.numel() for each in weights)
            optimiser = torch.optim.LBFGS(
                weights,
                max_iter=self.iterations,
                max_eval=2 * self.iterations,
                history_size=20,
                tolerance_grad=1e-8,
                tolerance_change=1e-10,
                line_search_fn="strong_wolfe",
            )

            def cost() -> torch.Tensor:
                optimiser.zero_grad()
                squares = torch.stack([(each**2).sum() for each in weights]).sum()
                mean = smoothed_absolute(self.network(seen)[:, 0] - wanted).mean() + self.penalty * squares / count
                torch.autograd.backward(mean)
                return mean

            optimiser.step(cost)

    def predict(self, features: Single) -> Single:
        return outputs(self.network, self._inputs(features))

    def model_multiply_adds(self) -> int:
        return weights_in(self.network)

    def _inputs(self, features: Single) -> Single:
        """Return what the network sees, shape ``(n, k)``."""
        now, creep = self.named(features, *VELOCITIES).T
        before = np.concatenate([np.full(self.build.whole("delay"), now[0]), now])[: len(now)]
        balance = self.features.has_base
        force = self.named(features, "force_balance_4_n")[:, 0] if balance else self.last_motion(features)
        stiction = np.where(np.abs(self.column(features, "velocity_m_s")) < CREEP_M_S, force, 0.0)
        change = CHANGE_SCALE * (now - before)
        return np.column_stack([now, creep, change, stiction, self.others(features)]).astype(np.float32)


MODELS = (
    RegisteredModel(
        name="machado",
        title="Neural friction compensator",
        family="related work",
        source="Machado et al. 2006",
        build=Machado,
        space={
            "nodes": (Int(6, 20), 10),
            "delay": (OneOf((1, 4, 10, 20)), 10),
            "penalty": (Float(1e-5, 1e-1, log=True), 1e-4),
        },
        chosen="labels as targets; stiction force: the force balance below 3 mm/s, the side of the last motion where "
        "no pressure is measured; the task's other columns are inputs too; corrects the force balance where raw "
        "pressures are there; L-BFGS on 24,000 rows; effort cuts its iterations (3200)",
    ),
)
