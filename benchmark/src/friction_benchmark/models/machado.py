"""Friction compensation by a small neural network, after Machado et al. 2006.

Source: Machado et al. 2006, a neural network friction compensator in the cascade control of a hydraulic actuator. The
paper itself was not at hand; from its citations: one small network, trained offline on the output of a model with a
variable friction coefficient, its own output fed forward; inputs are the velocity now and one sample ago and, at
standstill, the stiction force. What is left open is chosen here and described in ``MachadoEstimator``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from scipy.optimize import minimize

from friction_benchmark.models.perceptron import Perceptron, PerceptronEstimator
from friction_benchmark.models.related_work import (
    VELOCITIES,
    last_motion,
    places_of,
    smoothed_absolute,
    task_columns,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from cylinder_friction.arrays import Array
    from cylinder_friction.estimators.training_plan import SequenceData

    Single = NDArray[np.float32]

CREEP_M_S = 3e-3
"""Below this speed the stiction force is given: above the noise of the velocity of a 12-bit potentiometer."""

ROWS = 24_000
"""Training rows, drawn at random from all usable ones."""

CHANGE_SCALE = 10.0
"""Brings the change of a standardised velocity over some samples to the size of the velocity."""


@dataclass(frozen=True)
class MachadoPlan:
    """How the network is built and trained.

    Attributes:
        nodes: Of the one hidden layer.
        delay: Samples between the two velocities.
        penalty: Weight of the squared weights in the cost.
        iterations: Of the optimiser, at most.

    Raises:
        ValueError: A number is impossible.
    """

    nodes: int = 10
    delay: int = 10
    penalty: float = 1e-4
    iterations: int = 3_200

    def __post_init__(self) -> None:
        if self.nodes < 1 or self.delay < 1 or self.iterations < 1 or self.penalty < 0.0:
            raise ValueError(f"expected nodes, delay and iterations of at least 1 and no negative penalty, got {self}")


class MachadoEstimator(PerceptronEstimator[MachadoPlan]):
    """A perceptron of one hyperbolic layer on two velocities and the stiction force, without memory of its own.

    Chosen where the source leaves it open: the labels are the targets (a variable-coefficient model of the same labels
    could only be worse); 10 nodes; velocity also through a soft limit, the earlier velocity as a difference, which
    spans the same space and is better scaled; the stiction force is the force balance below 3 mm/s, and without
    pressures, where it is unknown, the direction of the last motion; the task's other columns are inputs too; all
    weights by L-BFGS (Liu and Nocedal 1989) on 24,000 rows, absolute error rounded at zero.
    """

    kind: ClassVar[str] = "machado"
    plan_type: ClassVar[type] = MachadoPlan

    def learn(self, train: Sequence[SequenceData]) -> None:
        generator = np.random.default_rng(self.seed)
        inputs = np.concatenate([self._inputs(self.new_memory(), each.features)[each.usable] for each in train])
        target = np.concatenate([each.target[each.usable] for each in train])
        drawn = generator.permutation(len(target))[:ROWS]
        self.network = _fit(inputs[drawn].astype(np.float64), target[drawn].astype(np.float64), self.plan, generator)

    def new_memory(self) -> Array:
        """Return the velocities of the last ``delay`` samples, NaN before the first."""
        return np.full(self.plan.delay, np.nan)

    def predict(self, memory: Array, features: Single) -> NDArray[Any]:
        assert self.network is not None
        return self.network.run(self._inputs(memory, features))

    def _inputs(self, memory: Array, features: Single) -> Single:
        """Return what the network sees, shape ``(n, k)``; changes ``memory``."""
        assert self.features is not None
        front_end, names = self.features, self.features.names
        now, creep = (features[:, place] for place in places_of(self.features, VELOCITIES))
        if len(now) and np.isnan(memory[0]):
            memory[:] = now[0]
        line = np.concatenate([memory, now.astype(np.float64)])
        memory[:] = line[len(now) :]
        change = CHANGE_SCALE * (line[self.plan.delay :] - line[: len(now)])
        place = names.index("velocity_m_s")
        speed = np.abs(now * front_end.scale[place] + front_end.mean[place])
        known = "force_balance_4_n" in names
        force = features[:, names.index("force_balance_4_n")] if known else last_motion(self.features, features)
        stiction = np.where(speed < CREEP_M_S, force, 0.0)
        others = features[:, places_of(self.features, task_columns(self.features))]
        return np.column_stack([now, creep, change, stiction, others]).astype(np.float32)


def _fit(rows: Array, target: Array, plan: MachadoPlan, generator: np.random.Generator) -> Perceptron:
    """Return the network of least mean cost with the penalty; its gradient comes from PyTorch in double precision."""
    import torch  # only training needs it

    from cylinder_friction.estimators.training import reproducible

    inputs, nodes = rows.shape[1], plan.nodes
    sizes = [inputs * nodes, nodes, nodes, 1]
    spread = np.repeat([inputs**-0.5, inputs**-0.5, nodes**-0.5, 0.0], sizes)
    seen, wanted = torch.from_numpy(rows), torch.from_numpy(target)

    def cost(values: Array) -> tuple[float, Array]:
        weights = torch.from_numpy(values.copy()).requires_grad_()
        kernel, bias, head, last = weights.split(sizes)
        output = (seen @ kernel.view(inputs, nodes) + bias).tanh() @ head + last
        mean = smoothed_absolute(output - wanted).mean() + plan.penalty * (weights @ weights) / len(weights)
        (gradient,) = torch.autograd.grad(mean, weights)
        return mean.item(), gradient.numpy()

    search: Any = minimize  # its type stubs know no function that gives its gradient beside its value
    with reproducible(0):
        found = search(
            cost,
            spread * generator.uniform(-1.0, 1.0, len(spread)),
            method="L-BFGS-B",
            jac=True,
            options={
                "maxiter": plan.iterations,
                "maxfun": 2 * plan.iterations,
                "maxcor": 20,
                "ftol": 1e-10,
                "gtol": 1e-8,
            },
        )
    kernel, bias, head, last = np.split(found.x.astype(np.float32), np.cumsum(sizes)[:-1])
    return Perceptron((kernel.reshape(inputs, nodes), head[:, None]), (bias, last), "tanh")
