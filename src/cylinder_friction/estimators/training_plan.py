"""What the training of a network takes and gives, free of PyTorch, which training alone needs."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np
from numpy.typing import NDArray

EpochReport = Callable[[int, float, float], None]
"""Called after each epoch with its number, training error and validation error (NaN without validation)."""


@dataclass(frozen=True)
class Architecture:
    """What the paper's Table I tunes in the network: layers, nodes per layer, dropout rate, learning rate.

    The defaults are those that the default search finds on the rig's campaign.

    Example:
        >>> from cylinder_friction.estimators.training_plan import Architecture
        >>> small = cf.HybridEstimator(cylinder, architecture=Architecture(layers=1, nodes=8))
        >>> small.architecture.nodes
        8
    """

    layers: int = 2
    nodes: int = 24
    dropout: float = 0.2
    learning_rate: float = 0.0094


@dataclass(frozen=True)
class TrainingPlan:
    """How long and in which pieces a network is trained.

    Raises:
        ValueError: A count is below 1, or ``burn_in``, ``warm_up`` or ``weight_decay`` is negative.

    Example:
        >>> from cylinder_friction.estimators.training_plan import TrainingPlan
        >>> cf.HybridEstimator(cylinder, plan=TrainingPlan(epochs=5)).plan.epochs
        5
    """

    epochs: int = 40  # Passes over the training recordings, at most
    # Epochs without a better validation error before training stops early; None: all epochs are trained, on all
    # recordings, and none is held out for validation
    patience: int | None = 12
    sequence_length: int = 200  # Samples between two updates; the state is carried over, the gradient is not
    burn_in: int = 100  # First samples of each recording that are not scored, while the state settles
    batch_size: int = 16  # Recordings trained on side by side
    # ``constant`` as in the paper, or ``cosine`` down to nothing over ``epochs``
    schedule: Literal["constant", "cosine"] = "cosine"
    warm_up: float = 0.0  # Share of training over which the learning rate rises to its highest
    weight_decay: float = 0.0  # Of AdamW (Loshchilov and Hutter 2019)

    def __post_init__(self) -> None:
        if min(self.epochs, self.patience or 1, self.sequence_length, self.batch_size) < 1:
            raise ValueError(f"expected epochs, patience, sequence_length and batch_size of at least 1, but got {self}")
        if min(self.burn_in, self.warm_up, self.weight_decay) < 0:
            raise ValueError(f"expected burn_in, warm_up and weight_decay of at least 0, but got {self}")


@dataclass(frozen=True)
class SequenceData:
    """One recording as the network sees it: features ``(n, k)`` float32, target ``(n,)``, mask ``(n,)``."""

    features: NDArray[np.float32]
    target: NDArray[np.float32 | np.float64]
    usable: NDArray[np.bool_]


@dataclass
class TrainingCurve:
    """Mean absolute error after each epoch, in units of the target; ``best_epoch`` counts from 1."""

    train_mae: list[float] = field(default_factory=list)
    validation_mae: list[float] = field(default_factory=list)
    best_epoch: int = 0


@dataclass(frozen=True)
class Checkpoint:
    """Training state on disk after each epoch: plain arrays, no pickle, whole or not at all."""

    # Holds ``checkpoint.npz``; name it after a hash of everything that training depends on, so that a checkpoint of
    # another configuration is never picked up
    folder: Path

    @property
    def path(self) -> Path:
        return self.folder / "checkpoint.npz"

    def save(self, arrays: dict[str, NDArray[Any]]) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        draft = self.folder / "draft.npz"
        np.savez(draft, allow_pickle=False, **cast("dict[str, Any]", arrays))
        draft.replace(self.path)

    def load(self) -> dict[str, NDArray[Any]] | None:
        """Return what was saved last, or None where nothing was."""
        if not self.path.is_file():
            return None
        with np.load(self.path, allow_pickle=False) as stored:
            return {name: stored[name] for name in stored.files}
