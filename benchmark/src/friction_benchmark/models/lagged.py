"""The past of the features, for models without memory of their own: earlier rows, and slow averages."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numba
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Rows = NDArray[np.float32]


@dataclass
class PastMemory:
    """The last rows, oldest first, shape ``(longest lag, k)``, and the averages, shape ``(averages, k)``; None before
    the first row."""

    rows: Rows | None = None
    averages: NDArray[np.float64] | None = None


@dataclass(frozen=True)
class Past:
    """Features now, some samples ago, and averaged over some time; causal, and cutting the rows changes no bit.

    Before the first row every lag repeats that row; averages begin at zero, the features' mean, because one row is a
    poor estimate of a mean.

    Attributes:
        lags: How many samples ago, each at least 1; empty for none.
        averages: Time constants of first-order averages, in samples, each at least 1; empty for none.

    Raises:
        ValueError: A lag or a time constant is below one sample.
    """

    lags: tuple[int, ...] = ()
    averages: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "lags", tuple(self.lags))  # lists, as they come out of JSON, are welcome
        object.__setattr__(self, "averages", tuple(self.averages))
        if any(lag < 1 for lag in self.lags) or any(average < 1.0 for average in self.averages):
            raise ValueError(f"expected lags and averages of at least 1 sample, but got {self}")

    def width(self, features: int) -> int:
        """Return how many columns ``advance`` gives for so many features."""
        return features * (1 + len(self.lags) + len(self.averages))

    def new_memory(self) -> PastMemory:
        return PastMemory()

    def advance(self, memory: PastMemory, features: Rows) -> Rows:
        """Return features, lagged and averaged ones side by side, shape ``(n, width(k))``, float32."""
        count = len(features)
        if count == 0:
            return np.empty((0, self.width(features.shape[1])), dtype=np.float32)
        longest = max(self.lags, default=0)
        if memory.rows is None or memory.averages is None:
            memory.rows = np.repeat(features[:1], longest, axis=0)
            memory.averages = np.zeros((len(self.averages), features.shape[1]))
        padded = np.concatenate([memory.rows, features])
        memory.rows = padded[len(padded) - longest :].copy()
        parts = [features, *(padded[longest - lag : longest - lag + count] for lag in self.lags)]
        parts += [
            _averaged(1.0 / average, memory.averages[number], np.ascontiguousarray(features))
            for number, average in enumerate(self.averages)
        ]
        return np.concatenate(parts, axis=1)

    def multiply_adds(self, features: int) -> int:
        return len(self.averages) * features


@numba.njit(cache=True)
def _averaged(weight: float, state: NDArray[np.float64], features: Rows) -> Rows:
    result = np.empty_like(features)
    for row in range(features.shape[0]):
        for column in range(features.shape[1]):
            state[column] += weight * (features[row, column] - state[column])
            result[row, column] = np.float32(state[column])
    return result
