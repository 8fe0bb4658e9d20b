"""What recurrent and convolutional networks share as estimators: training over whole sequences, and a slower step.

A network may step at every ``stride``-th sample and hold its output in between. The features that it sees and the force
balance that it corrects keep the sensors' rate, so what is held is the correction alone.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, Self

import numpy as np
import onnx

from cylinder_friction.estimators.training_plan import LearningCurve
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from friction_benchmark.models.learned import LearnedEstimator

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    import torch
    from numpy.typing import NDArray

    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.estimators.training_plan import SequenceData

    Single = NDArray[np.float32]

NETWORK_FILE = "network.onnx"


@dataclass(frozen=True)
class SequencePlan:
    """How a network is trained over whole sequences.

    Attributes:
        epochs: Passes over the training recordings, at most.
        patience: Epochs without a better validation error before training stops early.
        sequence_steps: Steps between two updates; the state is carried over, the gradient is not.
        batch_size: Recordings trained on side by side.
        stride: Samples between two steps of the network.
        cut_samples: Longest stretch of a recording that is trained on as one sequence; 0: all of it. Shorter stretches
            make more of them to go side by side, which is faster; each but a recording's first warms up unscored.
        weight_decay: Of AdamW.
        huber: Error [standard deviations] below which it is squared; 0: the mean absolute error.
    """

    epochs: int
    patience: int
    sequence_steps: int = 150
    batch_size: int = 16
    stride: int = 4
    cut_samples: int = 0
    weight_decay: float = 1e-3
    huber: float = 0.0

    def __post_init__(self) -> None:
        counts = (self.epochs, self.patience, self.sequence_steps, self.batch_size, self.stride)
        if min(counts) < 1:
            raise ValueError(f"expected epochs, patience, steps, batch size and stride of at least 1, but got {self}")
        if min(self.weight_decay, self.huber, self.cut_samples) < 0.0:
            raise ValueError(f"expected weight_decay, huber and cut_samples of at least 0, but got {self}")


class SteppedNetwork(Protocol):
    """A trained network at run time: plain arrays, stepped row by row."""

    @property
    def width(self) -> int:
        """Numbers in its last hidden state."""

    def new_state(self) -> Any:
        """Return the state before the first step."""

    def advance(self, state: Any, features: Single) -> tuple[Single, Single]:
        """Return hidden states, shape ``(n, width)``, and outputs, shape ``(n,)``; changes ``state``."""

    def multiply_adds(self) -> int:
        """Return the multiply-adds of one step."""


@dataclass
class HeldMemory:
    """State of the network, what it said last, and samples since then (0: the next sample is a step)."""

    network: Any
    hidden: Single
    head: Single
    phase: int = 0


class SequenceEstimator(LearnedEstimator):
    """A network over the features' sequence.

    A subclass gives its architecture's type, the network to train, the trained one as ONNX, and that at run time.

    Args:
        cylinder: Its areas.
        architecture: Of the network.
        plan: Of its training, and its stride.
        inputs: Columns that it sees.
        seed: Of weights, dropout, order and phase.
    """

    architecture_type: ClassVar[type]

    def __init__(
        self,
        cylinder: Cylinder,
        architecture: Any,
        plan: SequencePlan,
        inputs: Sequence[str] = SAMPLE_COLUMNS,
        seed: int = 0,
    ) -> None:
        super().__init__(cylinder, inputs, seed)
        self.architecture, self.plan = architecture, plan
        self.learning_curve = LearningCurve()
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
        from friction_benchmark.models.sequence_training import train_sequences  # PyTorch: training alone waits

        rate = self.architecture.learning_rate
        network, self.learning_curve = train_sequences(self.make_network, rate, self.plan, train, self.seed)
        self._set_network(self.to_onnx(network))

    def new_memory(self) -> HeldMemory:
        assert self.network is not None
        hidden, head = np.zeros((1, self.network.width), dtype=np.float32), np.zeros(1, dtype=np.float32)
        return HeldMemory(self.network.new_state(), hidden, head)

    def predict(self, memory: HeldMemory, features: Single) -> NDArray[Any]:
        return self.hold(memory, features)[1]

    def hold(self, memory: HeldMemory, features: Single) -> tuple[Single, Single]:
        """Return hidden states, shape ``(n, width)``, and outputs, ``(n,)``, of the latest step at each row."""
        assert self.network is not None
        stride, phase, rows = self.plan.stride, memory.phase, len(features)
        due = np.ascontiguousarray(features[-phase % stride :: stride])
        hidden, head = self.network.advance(memory.network, due)
        hidden, head = np.concatenate([memory.hidden, hidden]), np.concatenate([memory.head, head])
        latest = (phase + np.arange(rows)) // stride - (phase - 1) // stride
        memory.hidden, memory.head, memory.phase = hidden[-1:], head[-1:], (phase + rows) % stride
        return hidden[latest], head[latest]

    def model_multiply_adds(self) -> int:
        """Return the multiply-adds of a sample at which the network steps: the most that a sample costs."""
        assert self.network is not None
        return self.network.multiply_adds()

    def write_model(self, folder: Path) -> dict[str, Any]:
        assert self.model is not None
        (folder / NETWORK_FILE).write_bytes(self.model.SerializeToString(deterministic=True))
        return {"architecture": asdict(self.architecture), "plan": asdict(self.plan), "seed": self.seed}

    @classmethod
    def read_model(cls, folder: Path, content: dict[str, Any], cylinder: Cylinder, inputs: Sequence[str]) -> Self:
        architecture = cls.architecture_type(**content["architecture"])
        estimator = cls(cylinder, architecture, SequencePlan(**content["plan"]), inputs, content["seed"])
        estimator._load_network(folder)
        return estimator

    def _load_network(self, folder: Path) -> None:
        self._set_network(onnx.load(folder / NETWORK_FILE))

    def _set_network(self, model: onnx.ModelProto) -> None:
        self.model, self.network = model, self.from_onnx(model)
