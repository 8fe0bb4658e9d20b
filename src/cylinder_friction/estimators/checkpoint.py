"""Training state on disk after each epoch: plain arrays, no pickle, whole or not at all."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import numpy as np

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray


@dataclass(frozen=True)
class Checkpoint:
    """Where training stands.

    Attributes:
        folder: Holds ``checkpoint.npz``; name it after a hash of everything that training depends on, so that a
            checkpoint of another configuration is never picked up.
    """

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
