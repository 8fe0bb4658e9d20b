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
class Audit:
    """Collects the labels' errors one recording at a time, so that memory holds only sums.

    Call ``add`` for each recording with a known truth, then read ``rows``. ``merge`` combines audits of several
    processes; in the order of the recordings, the result has the same bits as a single audit.
    """

    event_window_s: float  # Rows within this time of a start, stop or reversal count as near it [s]
    # By filter, condition and stratum: rows, sums of the absolute error, the error and absolute friction, largest error
    _sums: dict[tuple[str, str, str], Array] = field(default_factory=dict)

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
                own, true_n = error[mask & usable], true_friction_n[mask & usable]
                sizes = np.abs(own)
                sums = np.array([len(own), sizes.sum(), own.sum(), np.abs(true_n).sum(), sizes.max(initial=0.0)])
                for group in (condition, ALL_CONDITIONS):
                    self._include((name, group, stratum), sums)

    def merge(self, other: "Audit") -> None:
        """Add the sums of another audit. Audits of one recording each, in order, give the same bits as ``add``."""
        for key, sums in other._sums.items():
            self._include(key, sums)

    def _include(self, key: tuple[str, str, str], sums: Array) -> None:
        before = self._sums.get(key, np.zeros(5))
        self._sums[key] = np.append(before[:4] + sums[:4], max(before[4], sums[4]))

    def rows(self) -> list[AuditRow]:
        """List the audit, sorted by filter, condition and stratum; a stratum without rows is left out."""
        order = {stratum: index for index, stratum in enumerate(STRATA)}
        keys = sorted(self._sums, key=lambda key: (key[0], key[1] == ALL_CONDITIONS, key[1], order[key[2]]))
        found = []
        for key in keys:
            count, absolute, signed, truth, largest = self._sums[key].tolist()
            if count:
                percent = 100.0 * absolute / truth if truth > 0.0 else 0.0
                means = absolute / count, largest, signed / count, truth / count
                found.append(AuditRow(*key, int(count), *means, percent))
        return found
