"""Measurement of the pressures' noise in a live session."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.recordings.columns import PRESSURES
from cylinder_friction.signals.noise import median_noise

WINDOW_ROWS, ROWS_BETWEEN, WINDOWS = 2000, 4000, 3
"""Rows of a window for measuring noise, rows between two windows, and number of windows that must agree."""


@dataclass(slots=True)
class NoiseWindow:
    """Measures the noise of a session's pressures in windows of samples.

    Pressures that oscillate in motion look noisier than they are, so the quietest of the latest windows counts.
    """

    inputs: Sequence[str]
    rows_to_wait: int = 0  # Rows before the first window; they differ, so that many sessions are not measured at once
    latest_pa: list[float] = field(default_factory=list)  # Noise in the latest windows
    _parts: list[Array] = field(default_factory=list)
    _rows: int = 0

    @property
    def noise_pa(self) -> float:
        """Noise of the quietest of the latest windows [Pa]; 0 before there are ``WINDOWS``, and without pressures."""
        return min(self.latest_pa) if len(self.latest_pa) == WINDOWS else 0.0

    def waits(self, rows: int) -> bool:
        """Count rows between two windows; return whether no window begins in them, and ``take`` need not see them."""
        if rows > self.rows_to_wait:
            return False
        self.rows_to_wait -= rows
        return True

    def take(self, samples: Array) -> None:
        """Take successive samples, shape ``(rows, inputs)``; NaN does not count."""
        if self.waits(len(samples)):
            return
        first, self.rows_to_wait = self.rows_to_wait, 0
        self._parts.append(samples[first:])
        self._rows += len(samples) - first
        if self._rows >= WINDOW_ROWS:
            window, self._parts = np.concatenate(self._parts)[:WINDOW_ROWS], []
            self._rows, self.rows_to_wait = 0, ROWS_BETWEEN
            pressures = window[:, [name in PRESSURES for name in self.inputs]]
            noise_pa = median_noise(pressures[np.isfinite(pressures).all(axis=1)].T)
            self.latest_pa = [*self.latest_pa, noise_pa][-WINDOWS:]
