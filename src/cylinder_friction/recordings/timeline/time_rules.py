"""What is done to a logger's time, and how far."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class TimeRules:
    """How raw time stamps become one constant rate.

    Attributes:
        rate_hz: Rate of the recording [Hz]; None for the slowest channel's own, oil temperature not counted.
        longest_bridge_samples: Up to this many lost samples in a row are interpolated; more split the recording.
        jitter_share: Stamps off an even clock by less than this share of a step count as even.
        damaged_share: More damaged stamps than this share of the rows and the order of the rows is not known.
        shortest_piece_samples: A stretch between two gaps that is shorter is left out.

    Raises:
        ValueError: A value is out of its range.
    """

    rate_hz: float | None = None
    longest_bridge_samples: int = 2
    jitter_share: float = 0.02
    damaged_share: float = 0.05
    shortest_piece_samples: int = 10

    def __post_init__(self) -> None:
        if self.rate_hz is not None and not 0.0 < self.rate_hz < math.inf:
            raise ValueError(f"expected rate_hz to be positive or None, but got {self.rate_hz!r}")
        if self.longest_bridge_samples < 0:
            raise ValueError(
                f"expected longest_bridge_samples to be 0 or more, but got {self.longest_bridge_samples!r}"
            )
        if not 0.0 <= self.jitter_share <= 0.25:
            raise ValueError(f"expected jitter_share to be in [0, 0.25], but got {self.jitter_share!r}")
        if not 0.0 <= self.damaged_share <= 0.5:
            raise ValueError(f"expected damaged_share to be in [0, 0.5], but got {self.damaged_share!r}")
        if self.shortest_piece_samples < 3:
            raise ValueError(
                f"expected shortest_piece_samples to be 3 or more, but got {self.shortest_piece_samples!r}"
            )
