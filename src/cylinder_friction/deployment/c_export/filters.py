"""The filter bank of the C: features, base force and velocity from the last raw samples.

In double precision sums run in the order of ``signals.causal.FirFilter``, so that not one bit differs. In single
precision each row filters differences from the newest sample, which are exact where samples are close, so that a
velocity does not drown in the rounding of a position. Equal rows are computed once, zeros at a row's ends not at all.
"""

from dataclasses import dataclass

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.realtime.model import StepModel

ROUNDING = 1e-9  # Taps with a smaller sum give nothing for a constant: derivatives


@dataclass(frozen=True)
class Term:
    """One input of a row: where its taps begin in the table, the lags they cover, and their sum."""

    start: int
    channel: int
    first: int
    count: int
    sum: float

    @property
    def passes_constants(self) -> bool:
        return abs(self.sum) > ROUNDING


class FilterBank:
    """The distinct rows of all filters of a model.

    Attributes:
        rows: Shape ``(rows, inputs, lags)``.
        feature: Row of each feature.
        base: Row of the base force; None where there is none.
        velocity: Row of the velocity.
        terms: Of each row, one per input that it takes.
        taps: Of all terms, one after the other.
    """

    def __init__(self, model: StepModel) -> None:
        base = [model.base_taps] if np.any(model.base_taps) else []
        every = [*model.feature_taps, model.velocity_taps, *base]
        lags = max(taps.shape[1] for taps in every)
        padded = np.stack([np.pad(taps, ((0, 0), (0, lags - taps.shape[1]))) for taps in every])
        _, first, place = np.unique(padded, axis=0, return_index=True, return_inverse=True)
        order = np.argsort(first)
        chosen = np.argsort(order)[place.ravel()].tolist()
        rows = padded[first[order]]
        used = np.flatnonzero(np.any(rows, axis=(0, 1)))
        self.rows: Array = rows[:, :, : int(used[-1]) + 1 if len(used) else 1]
        count = len(model.feature_taps)
        self.feature, self.velocity = tuple(chosen[:count]), chosen[count]
        self.base = chosen[-1] if base else None
        self.taps: list[float] = []
        self.terms = [self._terms(row) for row in self.rows]
        self.taps = self.taps or [0.0]

    @property
    def lags(self) -> int:
        return int(self.rows.shape[2])

    def operations(self) -> int:
        """Return the multiply-adds of one step."""
        return sum(term.count for terms in self.terms for term in terms)

    def _terms(self, row: Array) -> list[Term]:
        terms = []
        for channel, taps in enumerate(row):
            used = np.flatnonzero(taps)
            if len(used):
                first, last = int(used[0]), int(used[-1]) + 1
                terms.append(Term(len(self.taps), channel, first, last - first, float(taps.sum())))
                self.taps.extend(taps[first:last].tolist())
        return terms
