"""How noisy the pressures of a live session are."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.recordings.columns import PRESSURES
from cylinder_friction.signals.noise import median_noise

WINDOW_ROWS, ROWS_BETWEEN = 2000, 10_000
"""Rows that noise is measured from, and rows from one such window to the next."""


@dataclass(slots=True)
class NoiseWindow:
    """Measures the noise of a session's pressures, one window of samples after another."""

    inputs: Sequence[str]
    rows_to_wait: int = 0  # Before the first window; different ones keep many sessions from being measured at once
    noise_pa: float = 0.0  # In the latest window [Pa]; 0 before, and without pressures
    _parts: list[Array] = field(default_factory=list)
    _rows: int = 0

    def take(self, samples: Array) -> None:
        """Take successive samples in, shape ``(rows, inputs)``; those that are no numbers do not count."""
        first = min(self.rows_to_wait, len(samples))
        self.rows_to_wait -= first
        if first == len(samples):
            return
        self._parts.append(samples[first:])
        self._rows += len(samples) - first
        if self._rows >= WINDOW_ROWS:
            window, self._parts = np.concatenate(self._parts)[:WINDOW_ROWS], []
            self._rows, self.rows_to_wait = 0, ROWS_BETWEEN
            pressures = window[:, [name in PRESSURES for name in self.inputs]]
            self.noise_pa = median_noise(pressures[np.isfinite(pressures).all(axis=1)].T)
