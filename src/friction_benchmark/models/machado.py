"""Friction compensation by a small neural network, after Machado et al. 2006.

Source: Machado et al. 2006, a neural network friction compensator in the cascade control of a hydraulic actuator. The
paper itself was not at hand; from its citations: one small network, trained offline on what a model with a variable
friction coefficient says, its output fed forward; inputs the velocity now and one sample ago and, at standstill, the
stiction force. What is left open is chosen here and said in ``MachadoEstimator``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from scipy.optimize import minimize

from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from friction_benchmark.models.perceptron import Perceptron
from friction_benchmark.models.perceptron_estimator import PerceptronEstimator
from friction_benchmark.models.source_columns import VELOCITIES, last_motion, places_of, task_columns

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.estimators.features import Features
    from cylinder_friction.estimators.training_plan import SequenceData

    Single = NDArray[np.float32]
    Array = NDArray[np.float64]

Corrects = Literal["force balance", "nothing"]
CREEP_M_S = 3e-3
"""Slower, the stiction force is shown: above the noise of the velocity of a 12-bit potentiometer."""

ROWS = 24_000
"""Rows that are learnt from, drawn at random from all usable ones."""

KNEE = 0.05
"""Error, in standard deviations of the target, below which the cost turns from absolute to square."""

CHANGE_SCALE = 10.0
"""Brings the change of a standardised velocity over some samples to the size of the velocity."""

CHECKED = 20
"""Iterations between two looks at the validation rows."""


@dataclass(frozen=True)
class MachadoPlan:
    """How the network is made and trained.

    Attributes:
        nodes: Of the one hidden layer.
        delay: Samples between the two velocities.
        penalty: Weight of the squared weights in the cost.
        iterations: Of the optimiser, at most.
        corrects: ``force balance``: where raw pressures are there, their force balance is corrected. ``nothing``: the
            network is all of friction, and raw pressures count as stiction force at standstill alone, as in the source.

    Raises:
        ValueError: A number is impossible.
    """

    nodes: int = 10
    delay: int = 10
    penalty: float = 1e-4
    iterations: int = 3_200
    corrects: Corrects = "force balance"

    def __post_init__(self) -> None:
        if self.nodes < 1 or self.delay < 1 or self.iterations < 1 or self.penalty < 0.0:
            raise ValueError(f"expected nodes, delay and iterations of at least 1 and no negative penalty, got {self}")


class MachadoEstimator(PerceptronEstimator[MachadoPlan]):
    """A perceptron of one hyperbolic layer on two velocities and the stiction force, one sample after the other.

    Chosen where the source says nothing: the labels are the targets (a variable-coefficient model of the same labels
    could only be worse); 10 nodes; velocity also through a soft limit, the earlier velocity as a difference, which
    spans the same and is better scaled; the stiction force is the force balance below 3 mm/s, and without pressures,
    where nobody knows it, the direction of the last motion; the task's other columns are inputs too; all weights by
    L-BFGS (Liu and Nocedal 1989) on 24,000 rows, absolute error rounded at nought; those that are best on other rows,
    of validation recordings if there are some, are kept.

    Args:
        cylinder: Its areas.
        inputs: Columns that it sees.
        plan: Of network and training.
        seed: Of rows and first weights.

    Attributes:
        network: None before ``fit``.
    """

    kind: ClassVar[str] = "machado"
    plan_type: ClassVar[type] = MachadoPlan

    def __init__(
        self,
        cylinder: Cylinder,
        inputs: Sequence[str] = SAMPLE_COLUMNS,
        plan: MachadoPlan | None = None,
        seed: int = 0,
    ) -> None:
        super().__init__(cylinder, inputs, plan or MachadoPlan(), seed)

    def learn(self, train: Sequence[SequenceData]) -> None:
        generator = np.random.default_rng(self.seed)
        rows, targets = self._rows(train, generator)
        network = _fit(rows, targets, *self._rows(train, generator), self.plan, generator)
        self._use(network)

    def new_memory(self) -> Array:
        """Return the velocities of the last ``delay`` samples, NaN before the first."""
        return np.full(self.plan.delay, np.nan)

    def predict(self, memory: Array, features: Single) -> NDArray[Any]:
        assert self._runner is not None
        return self._runner.run(self._inputs(memory, features))

    def _set_features(self, features: Features) -> None:
        if self.plan.corrects == "nothing":
            features = replace(features, front_end=replace(features.front_end, base_taps=None))
        super()._set_features(features)

    def _inputs(self, memory: Array, features: Single) -> Single:
        """Return what the network sees, shape ``(n, k)``; changes ``memory``."""
        assert self.features is not None
        plan, names = self.features.front_end, self.features.names
        now, creep = (features[:, place] for place in places_of(self.features, VELOCITIES))
        if len(now) and np.isnan(memory[0]):
            memory[:] = now[0]
        line = np.concatenate([memory, now.astype(np.float64)])
        memory[:] = line[len(now) :]
        change = CHANGE_SCALE * (line[self.plan.delay :] - line[: len(now)])
        place = names.index("velocity_m_s")
        speed = np.abs(now * plan.scale[place] + plan.mean[place])
        known = "force_balance_4_n" in names
        force = features[:, names.index("force_balance_4_n")] if known else last_motion(self.features, features)
        stiction = np.where(speed < CREEP_M_S, force, 0.0)
        others = features[:, places_of(self.features, task_columns(self.features))]
        return np.column_stack([now, creep, change, stiction, others]).astype(np.float32)

    def _rows(self, recordings: Sequence[SequenceData], generator: np.random.Generator) -> tuple[Array, Array]:
        """Return inputs and targets of rows drawn from all recordings."""
        inputs = np.concatenate([self._inputs(self.new_memory(), each.features)[each.usable] for each in recordings])
        target = np.concatenate([each.target[each.usable] for each in recordings])
        drawn = generator.permutation(len(target))[:ROWS]
        return inputs[drawn].astype(np.float64), target[drawn].astype(np.float64)


def _fit(
    rows: Array, target: Array, unseen: Array, unseen_target: Array, plan: MachadoPlan, generator: np.random.Generator
) -> Perceptron:
    """Return the network of the iterate, every twentieth looked at, that is best on the unseen rows."""
    inputs, nodes = rows.shape[1], plan.nodes
    spread = np.concatenate([np.full((inputs + 1) * nodes, inputs**-0.5), np.full(nodes, nodes**-0.5), [0.0]])
    start = spread * generator.uniform(-1.0, 1.0, len(spread))
    best, kept, count = np.inf, start, 0

    def note(weights: Array) -> None:
        nonlocal best, kept, count
        count += 1
        if count % CHECKED == 0 or count == plan.iterations:
            error = float(np.mean(np.abs(_outputs(weights, nodes, unseen)[1] - unseen_target)))
            if error < best:
                best, kept = error, weights.copy()

    search: Any = minimize  # its type stubs know no function that gives its gradient beside its value
    found = search(
        lambda weights: _cost(weights, nodes, plan.penalty, rows, target),
        start,
        method="L-BFGS-B",
        jac=True,
        callback=note,
        options={"maxiter": plan.iterations, "maxfun": 2 * plan.iterations, "maxcor": 20, "ftol": 1e-10, "gtol": 1e-8},
    )
    count = plan.iterations - 1
    note(found.x)
    hidden, bias, head, last = _parts(kept.astype(np.float32), nodes)
    return Perceptron((hidden, head[:, None].copy()), (bias, np.array([last], dtype=np.float32)), "tanh")


def _parts(weights: NDArray[Any], nodes: int) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any], Any]:
    inputs = (len(weights) - 1) // nodes - 2
    edge = inputs * nodes
    hidden = weights[:edge].reshape(inputs, nodes)
    return hidden, weights[edge : edge + nodes], weights[edge + nodes : -1], weights[-1]


def _outputs(weights: Array, nodes: int, rows: Array) -> tuple[Array, Array]:
    """Return hidden outputs, shape ``(n, nodes)``, and the output, shape ``(n,)``, of all rows."""
    hidden, bias, head, last = _parts(weights, nodes)
    active = np.tanh(rows @ hidden + bias)
    return active, active @ head + last


def _cost(weights: Array, nodes: int, penalty: float, rows: Array, target: Array) -> tuple[float, Array]:
    """Return the mean of ``sqrt(e² + knee²) - knee`` with the penalty, and its gradient."""
    active, output = _outputs(weights, nodes, rows)
    error = output - target
    root = np.sqrt(error * error + KNEE**2)
    slope = error / root / len(target)
    head = weights[-1 - nodes : -1]
    inner = (slope[:, None] * head) * (1.0 - active * active)
    parts = [(rows.T @ inner).ravel(), inner.sum(axis=0), active.T @ slope, [slope.sum()]]
    gradient = np.concatenate(parts) + 2.0 * penalty * weights / len(weights)
    value = float(np.mean(root)) - KNEE + penalty * float(weights @ weights) / len(weights)
    return value, gradient
