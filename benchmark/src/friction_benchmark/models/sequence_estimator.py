"""What GRU and TCN share as estimators: training over whole sequences, and a slower step.

A network may step at every ``stride``-th sample and hold its output in between. The features that it sees and the force
balance that it corrects keep the sensors' rate, so what is held is the correction alone.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, Self

import numpy as np
import onnx

from cylinder_friction.estimators.onnx_files import write_onnx
from cylinder_friction.estimators.training_plan import TrainingCurve, TrainingPlan
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from friction_benchmark.models.learned import NETWORK_FILE, LearnedEstimator

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    import torch
    from numpy.typing import NDArray

    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.estimators.training_plan import SequenceData

    Single = NDArray[np.float32]


class SteppedNetwork(Protocol):
    """A trained network at run time: plain arrays, stepped row by row."""

    def new_state(self) -> Any:
        """Return the state before the first step."""

    def advance(self, state: Any, features: Single) -> Single:
        """Return the output after each row, shape ``(n,)``; changes ``state``."""

    def multiply_adds(self) -> int:
        """Return the multiply-adds of one step."""


@dataclass
class HeldMemory:
    """State of the network, its last output, and samples since then (0: the next sample is a step)."""

    network: Any
    head: Single
    phase: int = 0


class SequenceEstimator(LearnedEstimator):
    """A network over the features' sequence.

    A subclass gives its architecture's type, the network to train, the trained one as ONNX, and that at run time.

    Args:
        cylinder: Its areas.
        architecture: Of the network.
        plan: Of its training.
        inputs: Columns of a sample.
        seed: Seeds weights, dropout and batch order.
        stride: Samples between two steps of the network.
    """

    architecture_type: ClassVar[type]

    def __init__(
        self,
        cylinder: Cylinder,
        architecture: Any,
        plan: TrainingPlan,
        inputs: Sequence[str] = SAMPLE_COLUMNS,
        seed: int = 0,
        stride: int = 1,
    ) -> None:
        super().__init__(cylinder, inputs, seed)
        if stride < 1:
            raise ValueError(f"expected a stride of at least 1 sample, but got {stride!r}")
        self.architecture, self.plan, self.stride = architecture, plan, stride
        self.learning_curve = TrainingCurve()
        self.model: onnx.ModelProto | None = None
        self.network: SteppedNetwork | None = None

    @abstractmethod
    def make_network(self, inputs: int) -> torch.nn.Module:
        """Return the network to train: ``(features, state) -> (output, state)``, time first, None the first state."""

    @abstractmethod
    def to_onnx(self, network: Any) -> onnx.ModelProto:
        """Return a trained network as ONNX."""

    @abstractmethod
    def from_onnx(self, model: onnx.ModelProto) -> SteppedNetwork:
        """Return the network that ``to_onnx`` stored, ready to step."""

    def learn(self, train: Sequence[SequenceData]) -> None:
        from cylinder_friction.estimators.training import train_network  # PyTorch: training alone waits for it

        rate = self.architecture.learning_rate
        network, self.learning_curve = train_network(
            self.make_network, rate, self.plan, train, seed=self.seed, stride=self.stride
        )
        self._set_network(self.to_onnx(network))

    def new_memory(self) -> HeldMemory:
        assert self.network is not None
        return HeldMemory(self.network.new_state(), np.zeros(1, dtype=np.float32))

    def predict(self, memory: HeldMemory, features: Single) -> NDArray[Any]:
        """Return the output of the latest step at each row, shape ``(n,)``."""
        assert self.network is not None
        stride, phase, rows = self.stride, memory.phase, len(features)
        due = np.ascontiguousarray(features[-phase % stride :: stride])
        head = np.concatenate([memory.head, self.network.advance(memory.network, due)])
        latest = (phase + np.arange(rows)) // stride - (phase - 1) // stride
        memory.head, memory.phase = head[-1:], (phase + rows) % stride
        return head[latest]

    def model_multiply_adds(self) -> int:
        """Return the multiply-adds of a sample at which the network steps: the most that a sample costs."""
        assert self.network is not None
        return self.network.multiply_adds()

    def write_model(self, folder: Path) -> dict[str, Any]:
        assert self.model is not None
        write_onnx(self.model, folder / NETWORK_FILE)
        plan = {"plan": asdict(self.plan), "stride": self.stride}
        return {"architecture": asdict(self.architecture), **plan, "seed": self.seed}

    @classmethod
    def read_model(cls, folder: Path, content: dict[str, Any], cylinder: Cylinder, inputs: Sequence[str]) -> Self:
        architecture = cls.architecture_type(**content["architecture"])
        plan = TrainingPlan(**content["plan"])
        estimator = cls(cylinder, architecture, plan, inputs, content["seed"], content["stride"])
        estimator._set_network(onnx.load(folder / NETWORK_FILE))
        return estimator

    def _set_network(self, model: onnx.ModelProto) -> None:
        self.model, self.network = model, self.from_onnx(model)


def plain(value: torch.Tensor) -> Single:
    """Return a weight as a plain array."""
    return np.asarray(value.detach().cpu().numpy(), dtype=np.float32)
