"""Means over short pieces of recordings, from which load and mass are identified."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, ClassVar, Self

import numpy as np

from cylinder_friction.arrays import Array, Mask


@dataclass(frozen=True)
class Averages:
    """Means over pieces of recordings, all of shape ``(pieces,)``; a subclass adds group numbers, counted from 0."""

    group: ClassVar[str]
    """Name of the field with the number of each piece's stroke or cluster."""

    force_n: Array  # Drive force minus any known load, inertia included [N]
    position_m: Array
    velocity_m_s: Array
    acceleration_m_s2: Array

    def __len__(self) -> int:
        return len(self.force_n)

    def where(self, mask: Mask) -> Self:
        """Select pieces by a mask; groups keep their numbers."""
        return type(self)(*(values[mask] for values in vars(self).values()))

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Join the pieces of several recordings, with their groups numbered consecutively."""
        columns: dict[str, Any] = {
            field.name: np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(cls)
        }
        counts = [int(getattr(part, cls.group).max(initial=-1)) + 1 for part in parts]
        columns[cls.group] += np.repeat(np.cumsum([0, *counts[:-1]]), [len(part) for part in parts])
        return cls(**columns)
