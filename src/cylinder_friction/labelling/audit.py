"""Errors of the labels against true friction, by filter, if the truth is known; nothing is trained on them."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from cylinder_friction.arrays import Array, Mask
from cylinder_friction.recordings.columns import ALL_CONDITIONS
from cylinder_friction.signals.motion import EVENTS, event_masks, near_events

STRATA = ("all", "steady", "events", *EVENTS)
"""All usable rows; rows away from starts, stops and reversals; rows near them; and rows near each kind of event."""


@dataclass(frozen=True)
class AuditRow:
    """Errors of one filter's label against true friction, in one condition and stratum.

    Errors are in newtons, positive if the label is above the truth. Only simulated recordings have a truth. No model is
    trained on it.
    """

    filter: str  # Name of the filter
    condition: str  # Name of the operating condition, or ``all``
    stratum: str  # One of ``STRATA``
    rows: int  # Number of samples
    mae_n: float  # Mean absolute error [N]
    max_n: float  # Largest absolute error [N]
    bias_n: float  # Mean error, positive if the label is above the truth [N]
    mean_friction_n: float  # Mean absolute true friction of the same rows [N]
    mae_percent: float  # ``mae_n`` over ``mean_friction_n`` [%]


@dataclass
class _Sums:
    rows: int = 0
    absolute: float = 0.0
    signed: float = 0.0
    largest: float = 0.0
    truth: float = 0.0

    def add(self, error: Array, truth_n: Array) -> None:
        self.rows += len(error)
        self.absolute += float(np.abs(error).sum())
        self.signed += float(error.sum())
        self.largest = max(self.largest, float(np.abs(error).max(initial=0.0)))
        self.truth += float(np.abs(truth_n).sum())

    def merge(self, other: "_Sums") -> None:
        self.rows += other.rows
        self.absolute += other.absolute
        self.signed += other.signed
        self.largest = max(self.largest, other.largest)
        self.truth += other.truth


@dataclass
class Audit:
    """Collects the labels' errors one recording at a time, so that memory holds only sums.

    Call ``add`` for each recording with a known truth, then read ``rows``. ``merge`` combines audits of several
    processes; in the order of the recordings, the result has the same bits as a single audit.
    """

    event_window_s: float  # Rows within this time of a start, stop or reversal count as near it [s]
    _sums: dict[tuple[str, str, str], _Sums] = field(default_factory=dict)

    def add(
        self,
        condition: str,
        sample_time_s: float,
        labels_n: Mapping[str, Array],
        usable: Mask,
        true_friction_n: Array,
        true_velocity_m_s: Array,
    ) -> None:
        """Add one recording: the label of each filter by its name, and the truth, all of shape ``(n,)``.

        ``usable`` marks the rows that are usable for every filter, so that all filters are compared on the same rows.
        """
        window = round(self.event_window_s / sample_time_s)
        near = near_events(true_velocity_m_s, window)
        strata = {"all": np.ones_like(near), "steady": ~near, "events": near, **event_masks(true_velocity_m_s, window)}
        for name, label in labels_n.items():
            error = label - true_friction_n
            for stratum, mask in strata.items():
                rows = mask & usable
                for group in (condition, ALL_CONDITIONS):
                    sums = self._sums.setdefault((name, group, stratum), _Sums())
                    sums.add(error[rows], true_friction_n[rows])

    def merge(self, other: "Audit") -> None:
        """Add the sums of another audit. Audits of one recording each, in order, give the same bits as ``add``."""
        for key, sums in other._sums.items():
            self._sums.setdefault(key, _Sums()).merge(sums)

    def rows(self) -> list[AuditRow]:
        """List the audit, sorted by filter, condition and stratum; a stratum without rows is left out."""
        order = {stratum: index for index, stratum in enumerate(STRATA)}
        keys = sorted(self._sums, key=lambda key: (key[0], key[1] == ALL_CONDITIONS, key[1], order[key[2]]))
        return [_row(*key, self._sums[key]) for key in keys if self._sums[key].rows]


def _row(name: str, condition: str, stratum: str, sums: _Sums) -> AuditRow:
    return AuditRow(
        filter=name,
        condition=condition,
        stratum=stratum,
        rows=sums.rows,
        mae_n=sums.absolute / sums.rows,
        max_n=sums.largest,
        bias_n=sums.signed / sums.rows,
        mean_friction_n=sums.truth / sums.rows,
        mae_percent=100.0 * sums.absolute / sums.truth if sums.truth > 0.0 else 0.0,
    )
