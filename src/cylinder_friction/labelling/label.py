"""Labelling of filtered recordings: friction by the equation of motion, and the mask of usable rows."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal, get_args

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cylinder_friction.arrays import Array, Mask
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.labelling.audit import Audit
from cylinder_friction.labelling.equation_of_motion import Stiffness, friction_label
from cylinder_friction.labelling.load import LoadPlan
from cylinder_friction.labelling.mass import motion_points, raw_force
from cylinder_friction.labelling.pooled_load import pooled_load
from cylinder_friction.labelling.session import SessionIdentification, identify_session
from cylinder_friction.labelling.strokes import stroke_points
from cylinder_friction.labelling.uncertainty import (
    inertia_deviation,
    label_uncertainty,
    line_uncertainty,
    smoothing_deviation,
)
from cylinder_friction.realtime.position_load import PositionLoad
from cylinder_friction.recordings.checks.limits import GivenLoad, LoadMode, StatedLoad, load_of
from cylinder_friction.recordings.columns import LOAD_FORCE, OTHER_POSITIONS, PRESSURES, UNCERTAINTY_COLUMN
from cylinder_friction.recordings.recording import Recording, RecordingError, SensorUncertainty
from cylinder_friction.signals.methods import warn_of_rates
from cylinder_friction.signals.motion import widened
from cylinder_friction.signals.smooth_signals import (
    SMOOTH_LOAD,
    SignalFilter,
    Support,
    filtered,
    signals_of,
    smooth_columns,
)
from cylinder_friction.signals.zero_phase import default_filter

InertiaMode = Literal["given", "identified"]
"""Source of the moving mass: the cylinder's, or identified in each session whose motion determines it."""

ONLY_FOR_LABELS = (
    "pressure_1_smooth_pa",
    "pressure_2_smooth_pa",
    "drive_force_smooth_n",
    "load_force_smooth_n",
    "acceleration_m_s2",
)
"""Columns that only the label uses; ``labelled`` drops them."""

NO_STIFFNESS = Stiffness()


@dataclass(frozen=True)
class Labeller:
    """Settings and steps of labelling; use ``label`` unless you process recordings one at a time.

    Raises:
        ValueError: A mode is not known.
    """

    cylinder: Cylinder  # Areas, stroke and moving mass
    stiffness: Stiffness = field(default_factory=Stiffness)  # Spring in the equation of motion, if any
    end_stop_margin_m: float = 0.003  # Rows this near an end stop are not usable [m]
    # Source of the external force. ``none``: it is zero. ``measured``: a load cell. ``position``: a smooth function of
    # position, identified in each session
    load: LoadMode = "none"
    inertia: InertiaMode = "given"  # Source of the moving mass: ``given`` by the cylinder, or ``identified``
    load_plan: LoadPlan = field(default_factory=LoadPlan)  # How a load is identified, for ``load="position"``

    def __post_init__(self) -> None:
        for name, mode in (("load", LoadMode), ("inertia", InertiaMode)):
            if getattr(self, name) not in get_args(mode):
                raise ValueError(f"{name} must be one of {', '.join(get_args(mode))}, but got {getattr(self, name)!r}")

    @property
    def needs_identification(self) -> bool:
        """Whether load or mass of a session must be identified before its recordings can be labelled."""
        return self.load == "position" or self.inertia == "identified"

    def identify(self, recordings: Iterable[Recording], signal_filter: SignalFilter) -> SessionIdentification:
        """Identify load and moving mass of one session; only one of its filtered recordings is in memory at a time.

        Raises:
            RecordingError: The strokes do not determine the load, or the session hardly moves.
        """
        strokes, windows, others = [], [], tuple[str, ...]()
        for recording in recordings:
            signals, position_m = signals_of(recording), recording.column("position_m")
            load_n = self._load(recording, None)
            force_n = friction_label(signals, position_m, load_n, self.cylinder, self.stiffness)
            # The inertia of the given mass is added back, because the moving mass is being identified.
            force_n = force_n + self.cylinder.moving_mass_kg * signals.acceleration_m_s2
            step_s = recording.sample_time_s
            usable = usable_rows(
                position_m, self.cylinder.stroke_m, self.end_stop_margin_m, signal_filter.support(step_s)
            )
            if self.load == "position":
                motion = (force_n, position_m, signals.velocity_m_s, signals.acceleration_m_s2)
                limits = step_s, self.load_plan.slowest_m_s, self.load_plan.settling_travel_m
                others = tuple(column for column in OTHER_POSITIONS if column in recording.columns)
                others_m = recording.samples(others) if others else None
                pressures = (recording.column(name) for name in PRESSURES if name in recording.columns)
                pressure_pa = sum(pressures, np.zeros(len(recording)))  # 0 if no pressures were recorded
                strokes.append(stroke_points(*motion, pressure_pa, usable, *limits, others_m))
            if self.inertia == "identified":
                raw_n, chambers_n = raw_force(recording, self.cylinder)
                windows.append(motion_points(raw_n, position_m, signals.velocity_m_s, step_s, usable, chambers_n))
        return identify_session(strokes, windows, self.cylinder.moving_mass_kg, self.load_plan, others)

    def identify_sessions(
        self, sessions: Mapping[str, Iterable[Recording]], signal_filter: SignalFilter
    ) -> dict[str, SessionIdentification]:
        """Identify load and mass of each session, by session name; empty if neither is to be identified.

        Raises:
            RecordingError: As ``identify``; the message names the session.
        """
        identified: dict[str, SessionIdentification] = {}
        for session, recordings in sessions.items() if self.needs_identification else ():
            try:
                identified[session] = self.identify(recordings, signal_filter)
            except RecordingError as error:
                raise RecordingError(f"session {session!r}: {error}") from error
        return identified

    def label(
        self, recording: Recording, signal_filter: SignalFilter, identified: SessionIdentification | None = None
    ) -> Recording:
        """Add ``friction_n`` and ``usable`` to a recording that ``signal_filter`` has smoothed.

        An identified load is added as ``load_force_n``. If the sensors' uncertainty is stated, the recording also gets
        ``friction_uncertainty_n``, which includes smoothing and an identified load. If ``needs_identification``, pass
        the session's load and mass as ``identified``.

        Raises:
            RecordingError: The recording's columns and ``load`` contradict each other.
        """
        load_n, columns = self._load(recording, identified), dict[str, Array]()
        balanced = self._balanced(recording, load_n, signal_filter, identified)
        load_uncertainty_n: Array | float = 0.0
        if identified is not None and identified.load is not None:
            columns[LOAD_FORCE] = np.asarray(load_n)
            load_uncertainty_n = identified.load.uncertainty_n(recording.samples(identified.load.columns))
        lines_n = line_uncertainty(recording, self.cylinder, recording.column("velocity_m_s"))
        inertia_n = inertia_deviation(recording, (identified or self.cylinder).moving_mass_kg)
        smoothing_n = np.hypot(smoothing_deviation(recording, self.cylinder, signal_filter), lines_n)
        left_n = np.hypot(smoothing_n, inertia_n)
        uncertainty_n = label_uncertainty(recording, self.cylinder, load_uncertainty_n, left_n)
        if uncertainty_n is not None:
            columns[UNCERTAINTY_COLUMN] = uncertainty_n
        return recording.with_columns(**columns, **balanced)

    def labelled(
        self, recording: Recording, signal_filter: SignalFilter, identified: SessionIdentification | None = None
    ) -> Recording:
        """Label a recording and drop the columns that only labelling needs, for storage and training."""
        return self.label(recording, signal_filter, identified).without_columns(*ONLY_FOR_LABELS)

    def audit(
        self,
        recording: Recording,
        truth: pd.DataFrame,
        filters: Mapping[str, SignalFilter],
        into: Audit,
        identified: SessionIdentification | None = None,
    ) -> None:
        """Label a raw recording with every filter and add the errors, on the rows that are usable for all filters.

        ``truth`` has ``friction_n`` and ``velocity_m_s`` at the same rows.
        """
        labels = {}
        for name, each in filters.items():
            smooth = recording.with_columns(**smooth_columns(recording, each))
            labels[name] = self._balanced(smooth, self._load(smooth, identified), each, identified)
        into.add(
            recording.metadata.condition,
            recording.sample_time_s,
            {name: each["friction_n"] for name, each in labels.items()},
            np.logical_and.reduce([each["usable"] for each in labels.values()]),
            truth["friction_n"].to_numpy(dtype=np.float64),
            truth["velocity_m_s"].to_numpy(dtype=np.float64),
        )

    def _balanced(
        self,
        recording: Recording,
        load_n: Array | float,
        signal_filter: SignalFilter,
        identified: SessionIdentification | None,
    ) -> dict[str, NDArray[Any]]:
        """Compute ``friction_n`` and ``usable`` of a filtered recording with this load [N]."""
        if self.needs_identification and identified is None:
            raise ValueError(
                f"recording {recording.name!r}: expected load and mass of its session (Labeller.identify), but got None"
            )
        position_m = recording.column("position_m")
        cylinder = replace(self.cylinder, moving_mass_kg=(identified or self.cylinder).moving_mass_kg)
        friction_n = friction_label(signals_of(recording), position_m, load_n, cylinder, self.stiffness)
        support = signal_filter.support(recording.sample_time_s)
        usable = usable_rows(position_m, cylinder.stroke_m, self.end_stop_margin_m, support)
        if identified is not None and identified.load is not None:
            usable &= identified.load.knows(recording.samples(identified.load.columns))
        return {"friction_n": friction_n, "usable": usable}

    def _load(self, recording: Recording, identified: SessionIdentification | None) -> Array | float:
        """Compute the load of a filtered recording [N].

        Raises:
            RecordingError: The recording has a measured load but none is expected, or the reverse.
        """
        if (LOAD_FORCE in recording.columns) != (self.load == "measured"):
            raise RecordingError(f"recording {recording.name!r}: {_contradiction(self.load)}")
        if self.load == "measured":
            return recording.column(SMOOTH_LOAD)
        if identified is not None and identified.load is not None:
            return identified.load.load_n(recording.samples(identified.load.columns))
        return 0.0


def label(
    recordings: Iterable[Recording],
    cylinder: Cylinder,
    *,
    signal_filter: SignalFilter | None = None,
    load: GivenLoad | PositionLoad = "none",
    inertia: InertiaMode = "given",
    stiffness: Stiffness = NO_STIFFNESS,
    end_stop_margin_m: float = 0.003,
) -> list[Recording]:
    """Label recordings as the pipeline does: with velocity, friction and the mask of usable rows.

    It adds ``velocity_m_s``, ``friction_n`` and ``usable``; ``load_force_n`` if the load is identified; and
    ``friction_uncertainty_n`` if the sensors' uncertainty is stated. Labels use future samples, so make them off line.

    Args:
        recordings: Raw recordings in SI units, of any sessions and conditions, in the order of the result.
        cylinder: Cylinder, for its areas, stroke and moving mass.
        signal_filter: Smooths pressures and differentiates position; None: ``AdaptiveWindow`` with its defaults.
        load: As in ``Labeller``; or a weighed load in newtons with the limit of its error, ``"4218+-40"``; or a known
            load that depends on position. Weighed and known loads are the same in all sessions.
        inertia, stiffness, end_stop_margin_m: As in ``Labeller``.

    Raises:
        RecordingError: A recording's columns contradict ``load``, or a session does not determine its load.
        ValueError: There is no recording, or a mode is not known.

    Example:
        >>> labelled = cf.label(recordings, cylinder)
        >>> [name for name in labelled[0].columns if name not in recordings[0].columns]
        ['velocity_m_s', 'friction_uncertainty_n', 'friction_n', 'usable']
    """
    known = load if isinstance(load, PositionLoad) else None
    mode = "none" if isinstance(load, PositionLoad) else load_of(load)
    if isinstance(mode, StatedLoad):
        recordings = map(mode.added, recordings)
        mode = "measured"
    labeller = Labeller(cylinder, stiffness, end_stop_margin_m, mode, inertia)
    signal_filter = signal_filter or default_filter(cylinder)
    smooth = [filtered(recording, signal_filter) for recording in recordings]
    warn_of_rates(signal_filter, [recording.sample_time_s for recording in smooth])
    if not smooth:
        raise ValueError("label: expected at least one recording, but got none")
    identified = labeller.identify_sessions(by_session(smooth), signal_filter)
    labelled = [
        labeller.labelled(recording, signal_filter, identified.get(recording.metadata.session)) for recording in smooth
    ]
    return labelled if known is None else [with_common_load(recording, known) for recording in labelled]


def position_load(
    recordings: Iterable[Recording], cylinder: Cylinder, *, signal_filter: SignalFilter | None = None
) -> PositionLoad:
    """Identify a load that depends on position, such as a weight on a boom: the mean over the recordings' sessions.

    Pass the load to an estimator of a machine without a load cell. The recordings need strokes in both directions over
    the same travel. The arguments are those of ``label``.

    Raises:
        RecordingError: There is no recording, or the strokes of a session do not determine its load.

    Example:
        >>> weight_pa = 900.0 / cylinder.piston_area_m2  # as if a weight hung on the rod
        >>> loaded = [each.with_columns(pressure_1_pa=each.column("pressure_1_pa") + weight_pa) for each in recordings]
        >>> load = cf.position_load(loaded, cylinder)
        >>> knows_the_load = cf.HybridEstimator(cylinder, position_load=load)
    """
    signal_filter = signal_filter or default_filter(cylinder)
    sessions = by_session(filtered(recording, signal_filter) for recording in recordings)
    identified = Labeller(cylinder, load="position").identify_sessions(sessions, signal_filter)
    return pooled_load([each.load for each in identified.values() if each.load is not None])


def with_common_load(recording: Recording, load: PositionLoad) -> Recording:
    """Relabel a recording with a common ``load`` in place of its own session's load, if any.

    A session's own load has absorbed the sensors' offset and the uneven part of friction; a common load leaves both in
    friction. Rows at which the common load is unknown become unusable.
    """
    load_n = load.of(recording)
    own_n = recording.column(LOAD_FORCE) if LOAD_FORCE in recording.columns else 0.0
    changed = recording.with_columns(
        load_force_n=load_n,
        friction_n=recording.column("friction_n") + own_n - load_n,
        usable=recording.usable() & load.knows(recording),
    )
    who = changed.metadata
    known = {**who.uncertainty, LOAD_FORCE: SensorUncertainty(zero=0.0, span=0.0)} if who.uncertainty else {}
    return replace(changed, metadata=replace(who, uncertainty=known))


def by_session(recordings: Iterable[Recording]) -> dict[str, list[Recording]]:
    """Group recordings by the name of their session, in the order of the first recording of each."""
    sessions: dict[str, list[Recording]] = {}
    for recording in recordings:
        sessions.setdefault(recording.metadata.session, []).append(recording)
    return sessions


def usable_rows(position_m: Array, stroke_m: float, margin_m: float, support: Support) -> Mask:
    """Mark the usable rows, shape ``(n,)``.

    Three kinds of rows are unusable: rows within ``margin_m`` of an end stop, whose reaction would count as friction;
    rows whose filter's support includes such a row; and rows at the edges of the recording with incomplete support.
    """
    stopped = (position_m <= margin_m) | (position_m >= stroke_m - margin_m)
    usable = ~widened(stopped, before=support.after, after=support.before)
    usable[: support.before] = False
    usable[len(usable) - min(support.after, len(usable)) :] = False
    return usable


def _contradiction(load: LoadMode) -> str:
    if load == "measured":
        return (
            f"load (ingest.load) is measured, but there is no column {LOAD_FORCE!r}; map the load cell's channel to "
            "it, or set load to none or position"
        )
    return (
        f"load (ingest.load) is {load}, but a load was measured (column {LOAD_FORCE!r}); set load to measured, or "
        "leave its channel out of the mapping"
    )
