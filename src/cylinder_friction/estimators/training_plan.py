"""What a network's training is told and what it tells; free of PyTorch, which only training needs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

EpochReport = Callable[[int, float, float], None]


@dataclass(frozen=True)
class Architecture:
    """What the paper's Table I tunes in the network: layers, nodes per layer, dropout rate, learning rate."""

    layers: int
    nodes: int
    dropout: float
    learning_rate: float


@dataclass(frozen=True)
class TrainingPlan:
    """How long and in which pieces the network is trained.

    Attributes:
        epochs: Passes over the training recordings, at most.
        patience: Epochs without a better validation error before it stops early.
        sequence_length: Samples between two updates; the state is carried over, the gradient is not.
        burn_in: First samples of each recording that are not scored, while the state finds its place.
        batch_size: Recordings trained on side by side.
        schedule: ``constant`` as in the paper, or ``cosine`` down to nothing over ``epochs``.
    """

    epochs: int
    patience: int
    sequence_length: int
    burn_in: int
    batch_size: int
    schedule: Literal["constant", "cosine"] = "cosine"


@dataclass(frozen=True)
class SequenceData:
    """One recording as the network sees it: features ``(n, k)`` float32, target ``(n,)`` float32, mask ``(n,)``."""

    features: NDArray[np.float32]
    target: NDArray[np.float32]
    usable: NDArray[np.bool_]


@dataclass
class LearningCurve:
    """Mean absolute error after each epoch, in units of the target; ``best_epoch`` counts from 1."""

    train_mae: list[float] = field(default_factory=list)
    validation_mae: list[float] = field(default_factory=list)
    best_epoch: int = 0
