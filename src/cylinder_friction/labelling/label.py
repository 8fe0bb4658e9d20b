"""A filtered recording becomes a labelled one; every filter's label is held against the truth."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.labelling.equation_of_motion import Stiffness, friction_label
from cylinder_friction.labelling.masks import usable_rows
from cylinder_friction.signals.smooth import SmoothSignals

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pandas as pd
    from numpy.typing import NDArray

    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.labelling.audit import Audit
    from cylinder_friction.recordings import Recording
    from cylinder_friction.signals.smooth import Reach, SignalFilter

    Array = NDArray[np.float64]


@dataclass(frozen=True)
class Labeller:
    """How labels are made.

    Attributes:
        cylinder: Areas, stroke and moving mass.
        stiffness: Which spring enters the equation of motion, if any.
        end_stop_margin_m: Rows this near an end stop are not usable [m].
    """

    cylinder: Cylinder
    stiffness: Stiffness
    end_stop_margin_m: float

    def label(self, recording: Recording, reach: Reach) -> Recording:
        """Returns a filtered recording with ``friction_n`` and ``usable``; ``reach`` is that of its filter."""
        signals = SmoothSignals(*(recording.column(field.name) for field in fields(SmoothSignals)))
        friction_n, usable = self._from_signals(recording, signals, reach)
        return recording.with_columns(friction_n=friction_n, usable=usable)

    def audit(
        self, recording: Recording, truth: pd.DataFrame, filters: Mapping[str, SignalFilter], into: Audit
    ) -> None:
        """Adds the errors of every filter's label, on the rows that are usable for all of them.

        Args:
            recording: Its raw signals.
            truth: ``friction_n`` and ``velocity_m_s`` at the same rows.
            filters: By name.
            into: What collects the errors.
        """
        labels: dict[str, Array] = {}
        usable = np.ones(len(recording), dtype=np.bool_)
        for name, signal_filter in filters.items():
            signals = signal_filter.smooth(recording.samples(), recording.sample_time_s)
            reach = signal_filter.reach(recording.sample_time_s)
            labels[name], usable_here = self._from_signals(recording, signals, reach)
            usable &= usable_here
        into.add(
            recording.metadata.test,
            recording.sample_time_s,
            labels,
            usable,
            truth["friction_n"].to_numpy(dtype=np.float64),
            truth["velocity_m_s"].to_numpy(dtype=np.float64),
        )

    def _from_signals(
        self, recording: Recording, signals: SmoothSignals, reach: Reach
    ) -> tuple[Array, NDArray[np.bool_]]:
        position_m = recording.column("position_m")
        load_force_n = recording.column("load_force_n") if "load_force_n" in recording.table.columns else 0.0
        friction_n = friction_label(signals, position_m, load_force_n, self.cylinder, self.stiffness)
        return friction_n, usable_rows(position_m, self.cylinder.stroke_m, self.end_stop_margin_m, reach)
