"""Plan, data and results of a network's training. Only the training itself imports PyTorch."""

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
    """The hyperparameters of the network in the paper's Table I: layers, nodes per layer, dropout, learning rate.

    The default search on the rig's campaign found the defaults. More nodes cost time quadratically, in training and in
    each step; on a controller start with one layer of 8 to 16 nodes.

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
    """How long and in which pieces a network is trained: epochs, early stopping, batches, schedule.

    Training time grows with ``epochs`` and the recordings' length. Set ``patience`` to None if you have too few
    sessions to hold some out; the estimator then has no bounds until you ``calibrate`` it on other sessions.

    Raises:
        ValueError: A count is below 1, or ``burn_in``, ``warm_up`` or ``weight_decay`` is negative.

    Example:
        >>> from cylinder_friction.estimators.training_plan import TrainingPlan
        >>> cf.HybridEstimator(cylinder, plan=TrainingPlan(epochs=5)).plan.epochs
        5
    """

    epochs: int = 40  # Most passes over the training recordings
    # Epochs without a better validation error before training stops; None: train all epochs on all recordings, and
    # hold none out for validation
    patience: int | None = 12
    sequence_length: int = 200  # Samples between two updates; the state is carried over, the gradient is not
    burn_in: int = 100  # First samples of each recording, not scored while the state settles
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
    """One recording as the network's training reads it, ``n`` samples of ``k`` features.

    ``features`` has shape ``(n, k)``, float32, standardised; ``target`` has shape ``(n,)`` and is in newtons until
    ``train_correction`` scales it; ``usable``, shape ``(n,)``, masks the rows that count in the error.
    """

    features: NDArray[np.float32]
    target: NDArray[np.float32 | np.float64]
    usable: NDArray[np.bool_]


@dataclass
class TrainingCurve:
    """Mean absolute error after each epoch, in units of the target; ``best_epoch`` counts from 1.

    After ``fit``, ``HybridEstimator.learning_curve`` holds it in newtons. ``validation_mae`` stays empty without
    validation recordings; the best epoch is then the last one. Plot both lists to see whether training was long enough.
    """

    train_mae: list[float] = field(default_factory=list)
    validation_mae: list[float] = field(default_factory=list)
    best_epoch: int = 0


@dataclass(frozen=True)
class Checkpoint:
    """Training state on disk after each epoch, so that a killed training resumes with the same bits.

    The file holds plain arrays, never a pickle, and is written whole or not at all. The stages ``train`` and
    ``baselines`` use it; in a notebook pass one to ``HybridEstimator.fit``.
    """

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
        """Read the last saved state; None if there is none."""
        if not self.path.is_file():
            return None
        with np.load(self.path, allow_pickle=False) as stored:
            return {name: stored[name] for name in stored.files}
