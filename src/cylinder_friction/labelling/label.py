"""A filtered recording becomes a labelled one; every filter's label is held against the truth."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from cylinder_friction.labelling.equation_of_motion import Stiffness, friction_label
from cylinder_friction.labelling.masks import usable_rows
from cylinder_friction.labelling.uncertainty import UNCERTAINTY_COLUMN, label_uncertainty
from cylinder_friction.recordings.plausibility import LoadMode
from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.signals.recorded import LOAD_FORCE, SMOOTH_LOAD, signals_of, smooth_load, smooth_recording

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import pandas as pd
    from numpy.typing import NDArray

    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.labelling.audit import Audit
    from cylinder_friction.labelling.session import SessionFound, SessionPoints
    from cylinder_friction.recordings.recording import Recording
    from cylinder_friction.signals.smooth import Reach, SignalFilter, SmoothDrive, SmoothSignals

    Array = NDArray[np.float64]

InertiaMode = Literal["given", "identified"]
"""The moving mass is the cylinder's, or found in each session whose motion tells it."""


@dataclass(frozen=True)
class Labeller:
    """How labels are made.

    Attributes:
        cylinder: Areas, stroke and moving mass.
        stiffness: Which spring enters the equation of motion, if any.
        end_stop_margin_m: Rows this near an end stop are not usable [m].
        load: Where the outer force comes from: ``none``, it is zero; ``measured``, by a load cell; ``position``, it is
            a smooth function of position that is found in each session.
        inertia: Where the moving mass comes from.

    Raises:
        ValueError: A mode is not known.
    """

    cylinder: Cylinder
    stiffness: Stiffness
    end_stop_margin_m: float
    load: LoadMode = "none"
    inertia: InertiaMode = "given"

    def __post_init__(self) -> None:
        for name, mode in (("load", LoadMode), ("inertia", InertiaMode)):
            if getattr(self, name) not in get_args(mode):
                raise ValueError(f"{name} must be one of {', '.join(get_args(mode))}, but got {getattr(self, name)!r}")

    @property
    def asks_sessions(self) -> bool:
        """Whether each session has to be looked at before its recordings can be labelled."""
        return self.load == "position" or self.inertia == "identified"

    def collect(self, recording: Recording, reach: Reach, into: SessionPoints) -> None:
        """Add a filtered recording to what is known of its session."""
        signals = signals_of(recording)
        position_m = recording.column("position_m")
        load_n = self._load(recording, None, recording.column)
        force_n = friction_label(signals, position_m, load_n, self.cylinder, self.stiffness)
        usable = usable_rows(position_m, self.cylinder.stroke_m, self.end_stop_margin_m, reach)
        # The inertia of the given mass goes back in: which mass moves is what the session is asked.
        force_n = force_n + self.cylinder.moving_mass_kg * signals.acceleration_m_s2
        into.add(force_n, position_m, signals.velocity_m_s, signals.acceleration_m_s2, usable, recording.sample_time_s)

    def label(self, recording: Recording, reach: Reach, found: SessionFound | None = None) -> Recording:
        """Return a filtered recording with ``friction_n`` and ``usable``.

        An identified load is added as ``load_force_n``, and where the sensors' uncertainty is stated,
        ``friction_uncertainty_n``, which holds that of an identified load too.

        Args:
            recording: Filtered.
            reach: Of its filter.
            found: What its session tells; needed if ``asks_sessions``.

        Raises:
            RecordingError: The recording's columns and ``load`` contradict each other.
        """
        load_n = self._load(recording, found, recording.column)
        friction_n, usable = self._from_signals(recording, signals_of(recording), load_n, reach, found)
        columns: dict[str, Array] = {}
        load_uncertainty_n: Array | float = 0.0
        if self.load == "position" and found is not None and found.load is not None:
            columns[LOAD_FORCE] = np.asarray(load_n)
            load_uncertainty_n = found.load.uncertainty_n(recording.column("position_m"))
        uncertainty_n = label_uncertainty(recording, self.cylinder, load_uncertainty_n)
        if uncertainty_n is not None:
            columns[UNCERTAINTY_COLUMN] = uncertainty_n
        return recording.with_columns(**columns, friction_n=friction_n, usable=usable)

    def audit(
        self,
        recording: Recording,
        truth: pd.DataFrame,
        filters: Mapping[str, SignalFilter],
        into: Audit,
        found: SessionFound | None = None,
    ) -> None:
        """Add the errors of every filter's label, on the rows that are usable for all of them.

        Args:
            recording: Its raw signals.
            truth: ``friction_n`` and ``velocity_m_s`` at the same rows.
            filters: By name.
            into: What collects the errors.
            found: What its session tells, by the filter that is used; needed if ``asks_sessions``.
        """
        labels: dict[str, Array] = {}
        usable = np.ones(len(recording), dtype=np.bool_)
        for name, signal_filter in filters.items():
            signals = smooth_recording(recording, signal_filter)
            reach = signal_filter.reach(recording.sample_time_s)
            load_n = self._load(recording, found, partial(_smooth_load, recording, signal_filter))
            labels[name], usable_here = self._from_signals(recording, signals, load_n, reach, found)
            usable &= usable_here
        into.add(
            recording.metadata.condition,
            recording.sample_time_s,
            labels,
            usable,
            truth["friction_n"].to_numpy(dtype=np.float64),
            truth["velocity_m_s"].to_numpy(dtype=np.float64),
        )

    def _from_signals(
        self,
        recording: Recording,
        signals: SmoothSignals | SmoothDrive,
        load_n: Array | float,
        reach: Reach,
        found: SessionFound | None,
    ) -> tuple[Array, NDArray[np.bool_]]:
        if self.asks_sessions and found is None:
            raise ValueError(
                f"recording {recording.name!r}: expected what its session tells of load and mass "
                "(SessionPoints.found), but got None"
            )
        position_m = recording.column("position_m")
        cylinder = self.cylinder
        if found is not None and found.moving_mass_kg != cylinder.moving_mass_kg:
            cylinder = replace(cylinder, moving_mass_kg=found.moving_mass_kg)
        friction_n = friction_label(signals, position_m, load_n, cylinder, self.stiffness)
        usable = usable_rows(position_m, cylinder.stroke_m, self.end_stop_margin_m, reach)
        if self.load == "position" and found is not None and found.load is not None:
            usable &= found.load.coverage.holds(position_m)
        return friction_n, usable

    def _load(
        self, recording: Recording, found: SessionFound | None, smooth: Callable[[str], Array | None]
    ) -> Array | float:
        """Return the load [N]; ``smooth`` gives the measured one by the name of its smooth column.

        Raises:
            RecordingError: A load was measured where none is expected, or the other way round.
        """
        measured = LOAD_FORCE in recording.table.columns
        if measured != (self.load == "measured"):
            raise RecordingError(f"recording {recording.name!r}: {_contradiction(self.load)}")
        if self.load == "measured":
            load_n = smooth(SMOOTH_LOAD)
            assert load_n is not None
            return load_n
        if self.load == "position" and found is not None:
            assert found.load is not None
            return found.load.load_n(recording.column("position_m"))
        return 0.0


def _smooth_load(recording: Recording, signal_filter: SignalFilter, _: str) -> Array | None:
    return smooth_load(recording, signal_filter)


def _contradiction(load: LoadMode) -> str:
    if load == "measured":
        return (
            f"label.load is measured, but there is no column {LOAD_FORCE!r}; map the load cell's channel to it, or set "
            "label.load to none or position"
        )
    return (
        f"label.load is {load}, but a load was measured (column {LOAD_FORCE!r}); set label.load to measured, or leave "
        "its channel out of the mapping"
    )
