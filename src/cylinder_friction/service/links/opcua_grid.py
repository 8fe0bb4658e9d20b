"""Values of single OPC UA nodes put on the model's sample grid by their source time stamps."""

import math
from collections import Counter

import numpy as np

from cylinder_friction.arrays import Array


class SampleGrid:
    """Rows of one session, from values that come one by one, each with its own time.

    A row's index is its time since 1970 in sample times, so that a new start of anything goes on by itself. A row is
    given once all its inputs are there, or when ``hold_s`` has passed since its first; inputs that did not come are no
    numbers then. Rows of which nothing came are not given: the session finds the gap by its index.

    Args:
        sample_time_s: Time between two rows [s].
        columns: Inputs of a row.
        hold_s: How long a row waits for the rest of its inputs [s].
        counts: ``values``, ``doubled`` (its row had one already: time stamps jitter, or come too fast),
            ``late`` (its row had been given) and ``incomplete`` (rows with inputs that did not come).
    """

    def __init__(self, sample_time_s: float, columns: int, hold_s: float, counts: Counter[str]) -> None:
        self._sample_time_s, self._columns, self._hold_s, self._counts = sample_time_s, columns, hold_s, counts
        self._rows: dict[int, Array] = {}
        self._missing: dict[int, set[int]] = {}
        self._since_s: dict[int, float] = {}
        self._given = -1

    def put(self, column: int, time_s: float, value: float, now_s: float) -> None:
        """Take a value in; one that is no number stands for a bad status."""
        index = math.floor(time_s / self._sample_time_s + 0.5)
        self._counts["values"] += 1
        if index <= self._given:
            self._counts["late"] += 1
            return
        if index not in self._rows:
            self._rows[index] = np.full(self._columns, np.nan)
            self._missing[index], self._since_s[index] = set(range(self._columns)), now_s
        if column not in self._missing[index]:
            self._counts["doubled"] += 1
        self._missing[index].discard(column)
        self._rows[index][column] = value

    def take(self, now_s: float) -> list[tuple[int, Array]]:
        """Return what can be given, as runs of successive rows: index of the first, samples ``(rows, columns)``."""
        runs: list[tuple[int, list[Array]]] = []
        for index in sorted(self._rows):
            missing = self._missing[index]
            if missing and now_s - self._since_s[index] < self._hold_s:
                break
            self._counts["incomplete"] += bool(missing)
            if runs and runs[-1][0] + len(runs[-1][1]) == index:
                runs[-1][1].append(self._rows[index])
            else:
                runs.append((index, [self._rows[index]]))
            self._given = index
            del self._rows[index], self._missing[index], self._since_s[index]
        return [(index, np.stack(rows)) for index, rows in runs]
