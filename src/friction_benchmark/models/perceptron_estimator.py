"""What the estimators share whose model is one multilayer perceptron: its place, its cost, its file."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, Generic, Self, TypeVar

from friction_benchmark.models.learned import LearnedEstimator
from friction_benchmark.models.perceptron import Perceptron, PerceptronRunner, read_perceptron, write_perceptron

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from cylinder_friction.cylinder import Cylinder

NETWORK_FILE = "network.onnx"
Plan = TypeVar("Plan")


class PerceptronEstimator(LearnedEstimator, Generic[Plan]):
    """A learned estimator whose model is a perceptron beside a plan of how it was made.

    A subclass gives its plan's type, ``learn``, which ends in ``_use``, ``new_memory`` and ``predict``; its constructor
    takes what this one takes.

    Args:
        cylinder: Its areas.
        inputs: Columns that it is given.
        plan: Of network and training, a dataclass of plain values.
        seed: Of everything random.

    Attributes:
        network: None before ``fit``.
    """

    plan_type: ClassVar[type]

    def __init__(self, cylinder: Cylinder, inputs: Sequence[str], plan: Plan, seed: int) -> None:
        super().__init__(cylinder, inputs, seed)
        self.plan = plan
        self.network: Perceptron | None = None
        self._runner: PerceptronRunner | None = None

    def model_multiply_adds(self) -> int:
        """Return those of one step of the network: the worst case where it does not step at every sample."""
        assert self.network is not None
        return self.network.multiply_adds()

    def write_model(self, folder: Path) -> dict[str, Any]:
        assert self.network is not None
        write_perceptron(folder / NETWORK_FILE, self.network)
        return {"plan": vars(self.plan), "seed": self.seed}

    @classmethod
    def read_model(cls, folder: Path, content: dict[str, Any], cylinder: Cylinder, inputs: Sequence[str]) -> Self:
        estimator = cls(cylinder, inputs, cls.plan_type(**content["plan"]), content["seed"])
        estimator._use(read_perceptron(folder / NETWORK_FILE))
        return estimator

    def _use(self, network: Perceptron) -> None:
        self.network, self._runner = network, PerceptronRunner(network)
