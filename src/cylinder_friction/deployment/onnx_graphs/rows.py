"""The past that the guard depends on: a memory in the step graph, whole columns in the sequence graph.

The guard is written once (``checks.py``), on tensors of ``n`` rows: one row in the step graph, all rows from the first
sound sample on in the sequence graph.
"""

from typing import Protocol

from cylinder_friction.realtime.history import History

LONG_AGO = -1e30  # Clock of something that never happened
FAR = 1e30  # Place from which everything has moved: keeps a frozen channel frozen until it changes

CHANGED_AT = "changed_at"
"""Position at which each pressure, and clock at which the position, last changed, shape ``(n, pressures + 1)``."""
HAPPENED_AT = "happened_at"
"""Clock of the last bad sample, and of the reset, shape ``(n, 2)``."""
TURNED_AT = "turned_at"  # Clock of the last reversal or start of motion, shape ``(n, 1)``
UNMODELLED = "unmodelled"  # Samples of motion since the last force beyond the range of training, shape ``(n, 1)``
DIRECTION = "direction"  # Of motion, -1, 0 or 1, shape ``(n, 1)``


class Rows(Protocol):
    """Rows of samples and their past. Tensors go by name.

    Attributes:
        sample: The sensors' values, invalid ones replaced by the last valid ones, shape ``(n, inputs)``.
        channels: The same with the load that position decides, where the model has one, shape ``(n, channels)``.
        accepted: Which of them are the sensors' own, shape ``(n, inputs)``.
        clock: Steps since the first valid sample, that one included, shape ``(n, 1)``.
        window: The last channels, newest first, shape ``(n, channels · lags)``.
        never: False in every row, shape ``(n, 1)``.
        single: Whether there is one row whose state goes in and out.
        lags: How many samples make a window.
    """

    sample: str
    channels: str
    accepted: str
    clock: str
    window: str
    never: str
    single: bool
    lags: int

    def latest(self, what: str, values: str, fresh: str) -> str:
        """Return ``values`` as they were at the last row where ``fresh`` held, per column."""

    def latched(self, what: str, over: str, fresh: str) -> str:
        """Return whether ``over`` has held at any row since ``fresh`` last did, per column."""

    def since(self, what: str, happens: str, counts: str) -> str:
        """Return how many rows before, where ``counts`` held, came after the last where ``happens`` did, ``(n, 1)``."""

    def lasting(self, holds: str) -> str:
        """Return for how many rows, this one included, something has held, as numbers, per column of three."""

    def advance_history(self, history: History, smooth_m: str, sample_time_s: float) -> str:
        """Return the history features of the smoothed positions, shape ``(n, 6)``."""

    def direction_before(self, direction: str) -> str:
        """Return the direction of the step before, 0 at the first."""
