"""The recording: one table at one constant sample rate in SI units, with metadata."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cylinder_friction.arrays import Array, Mask
from cylinder_friction.recordings.channel_correction import ChannelCorrection
from cylinder_friction.recordings.columns import (
    DRIVE_FORCE,
    POSITION,
    REQUIRED_COLUMNS,
    SAMPLE_COLUMNS,
    TIME,
    UNCERTAINTY_COLUMN,
)
from cylinder_friction.recordings.line_loss import LineLoss
from cylinder_friction.refusal import RefusalError

Columns = Mapping[str, NDArray[Any]]  # Columns of equal length by name, in their order


class RecordingError(RefusalError, ValueError):
    """A log, mapping or recording that cannot be used. Whatever reads, maps, aligns or checks one may raise it.

    The message states what, where, found, expected and what to do.
    """


def expect(valid: object, name: str, expected: str, found: object) -> None:
    """Refuse a setting that is not ``valid``."""
    if not valid:
        raise RecordingError(f"{name}: expected {expected}, but got {found!r}")


def missing_columns(columns: Collection[str]) -> list[str]:
    """List the required columns that are missing; a drive force replaces both pressures."""
    required = (TIME, POSITION) if DRIVE_FORCE in columns else REQUIRED_COLUMNS
    return [column for column in required if column not in columns]


@dataclass(frozen=True)
class SensorUncertainty:
    """Standard uncertainty (k = 1) of what a sensor reads.

    A transmitter keeps its zero: unless it is ``zeroed`` before each session, all sessions may have the same error of
    the zero, as large as ``zero``, and no number of sessions averages it away.

    Example:
        >>> from cylinder_friction.recordings.recording import SensorUncertainty
        >>> SensorUncertainty(zero=3e3, span=0.0005, resolution=6.1e3).zero  # a transmitter zeroed to within 0.03 bar
        3000.0
    """

    zero: float  # Uncertainty of its zero, which is constant within a recording, in the column's unit
    span: float  # Uncertainty of its gain, as a share of the reading
    resolution: float = 0.0  # Step of its converter, in the column's unit; 0 if not known
    zeroed: bool = False  # Whether it is zeroed anew before each session


@dataclass(frozen=True)
class IdentifiedZero:
    """A sensor's reading at zero, identified from the motion of its session and not yet subtracted from its column."""

    offset: float  # Offset at the first row, in the column's unit
    uncertainty: float  # Remaining standard uncertainty (k = 1), in the column's unit
    drift: float = 0.0  # Drift of the offset, in the column's unit per second


@dataclass(frozen=True)
class RecordingMetadata:
    """Metadata of a recording: name, condition, session, sample time, source file and sensors.

    Give recordings one session if they share a calibration of the sensors. Splits keep sessions whole, and each
    session has one sensor offset.

    Example:
        >>> from cylinder_friction.recordings.recording import RecordingMetadata
        >>> RecordingMetadata(name="monday_07", condition="1", session="monday", sample_time_s=0.005).start
        ''
    """

    name: str  # Unique; also the stem of the recording's file
    condition: str  # Label of the operating condition, for example ``"1"`` for the paper's Test 1 (no load)
    session: str  # One uninterrupted stretch of laboratory work with one calibration; splits keep it whole
    sample_time_s: float  # Constant time between two rows [s]
    cylinder: str = ""  # Name of the cylinder
    load: str = ""  # Load of the cylinder, in words
    source_file: str = ""  # File of the recording, relative to the folder that was ingested
    source_sha256: str = ""  # Hash of that file's bytes
    # Time of its first sample in ISO 8601: with Z in UTC; otherwise by the logger's clock, whose time zone is not
    # stated. A day alone if only that is known; empty if nothing is
    start: str = ""
    start_source: str = ""  # Source of ``start``; without one, why it is not known, if that is odd
    asset: str = ""  # The machine that the cylinder belongs to
    # Serial number and day of calibration of the sensor behind a column, if they are stated
    sensors: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    # SHA-256 of what its friction depends on besides its file: cylinder, mapping, model, version of the code
    depends_on: Mapping[str, str] = field(default_factory=dict)
    # Sensor's reading at zero that was subtracted from a column, in the column's unit
    zero_offset: Mapping[str, float] = field(default_factory=dict)
    # Uncertainty of the sensor behind a column, if it is stated
    uncertainty: Mapping[str, SensorUncertainty] = field(default_factory=dict)
    # Sign and offset that the mapping states for a column and ingest has applied, if there is either
    corrections: Mapping[str, ChannelCorrection] = field(default_factory=dict)
    # Stated pressure loss in the line between a sensor and its chamber, by column; friction does not include it
    line_loss: Mapping[str, LineLoss] = field(default_factory=dict)
    # Identified zero of the sensor behind a column, which is not yet subtracted from the column
    identified_zero: Mapping[str, IdentifiedZero] = field(default_factory=dict)
    repairs: tuple[str, ...] = ()  # Repairs by ingest, one sentence each

    @property
    def remarks(self) -> tuple[str, ...]:
        """Repairs, and why the start is not known."""
        return (*self.repairs, self.start_source) if self.start_source and not self.start else self.repairs

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Self:
        known = {column: SensorUncertainty(**entry) for column, entry in values.get("uncertainty", {}).items()}
        zeros = {column: IdentifiedZero(**entry) for column, entry in values.get("identified_zero", {}).items()}
        lines = {column: LineLoss(**entry) for column, entry in values.get("line_loss", {}).items()}
        read = {column: ChannelCorrection(**entry) for column, entry in values.get("corrections", {}).items()}
        made: dict[str, Any] = {"uncertainty": known, "identified_zero": zeros, "line_loss": lines, "corrections": read}
        return cls(**values | made | {"repairs": tuple(values.get("repairs", ()))})

    def to_dict(self) -> dict[str, Any]:
        return {name: value for name, value in asdict(self).items() if value or name not in _OPTIONAL}


_OPTIONAL = ("line_loss", "corrections")  # Fields that are not stored if they are empty
UNNAMED = RecordingMetadata("", "", "", 0.0)  # Metadata of columns that do not belong to a file yet


@dataclass(frozen=True, init=False, repr=False, eq=False)
class Recording:
    """Columns at one constant sample rate, with read-only values.

    Names of columns end with their unit. Every recording has ``time_s`` and ``position_m`` (extension positive), and
    ``pressure_1_pa`` (piston side, gauge) and ``pressure_2_pa`` (rod side, gauge) unless it has ``drive_force_n``.
    Later stages add ``velocity_m_s``, ``acceleration_m_s2``, ``friction_n`` (positive when it opposes positive
    velocity) and ``usable`` (mask).

    Example:
        >>> recording = labelled[0]
        >>> recording.metadata.condition, recording.metadata.session
        ('1', 'condition1_session01')
        >>> friction_n = recording.column("friction_n")[recording.usable()]
        >>> recording.samples().shape  # pressure 1, pressure 2 and position of every sample
        (6000, 3)
    """

    metadata: RecordingMetadata
    columns: Columns

    def __init__(self, metadata: RecordingMetadata, columns: Columns | pd.DataFrame) -> None:
        """Check a table's columns, and keep them without a copy; refuse missing ones, other shapes and NaN."""
        own = {str(name): _read_only(values) for name, values in columns.items()}
        self.__dict__.update(metadata=metadata, columns=own)
        if missing := missing_columns(self.columns):
            expected = f"{list(REQUIRED_COLUMNS)} (or {TIME}, {POSITION} and {DRIVE_FORCE})"
            got = f"got columns {list(self.columns)}, expected at least {expected}"
            raise RecordingError(f"recording {self.name!r}: column {missing[0]!r} is missing; {got}")
        self._check_shapes()
        for name in (*SAMPLE_COLUMNS, DRIVE_FORCE):
            if name in self.columns:
                refuse_not_finite(self.name, self.column(name)[:, None], (name,))

    @classmethod
    def unchecked(cls, metadata: RecordingMetadata, columns: Columns) -> Self:
        """Make a recording of columns without checking them."""
        recording = object.__new__(cls)
        recording.__dict__.update(metadata=metadata, columns=columns)
        return recording

    def described(self, **changes: Any) -> Recording:
        """Return a copy with changed metadata and the same columns."""
        return Recording.unchecked(replace(self.metadata, **changes), self.columns)

    def _check_shapes(self) -> None:
        rows = (len(self),)
        for name, values in self.columns.items():
            if values.shape != rows:
                got = f"column {name!r} has shape {values.shape}, expected {rows} as {TIME}"
                raise RecordingError(f"recording {self.name!r}: {got}; give one value for each row")

    def __repr__(self) -> str:
        rows, who = len(self), self.metadata
        return (
            f"Recording({who.name!r}, condition {who.condition!r}, session {who.session!r}, {rows} rows, "
            f"{rows * self.sample_time_s:.4g} s, columns {', '.join(self.columns)})"
        )

    @property
    def name(self) -> str:
        return self.metadata.name

    @property
    def sample_time_s(self) -> float:
        return self.metadata.sample_time_s

    @cached_property
    def table(self) -> pd.DataFrame:
        return pd.DataFrame(dict(self.columns), copy=False)

    def __len__(self) -> int:
        return len(self.columns[TIME])

    def column(self, name: str) -> Array:
        """Return one column as float64, shape ``(n,)``; raise ``RecordingError`` if it does not exist."""
        if name not in self.columns:
            raise RecordingError(
                f"recording {self.name!r}: column {name!r} is missing; got columns {list(self.columns)}; "
                "run the stage that adds it (filter adds velocity, label adds friction), or log it"
            )
        return np.asarray(self.columns[name], dtype=np.float64)

    def samples(self, columns: Sequence[str] = SAMPLE_COLUMNS) -> Array:
        """Return the input of an estimator, shape ``(n, k)``: by default the raw samples P1 [Pa], P2 [Pa], x [m]."""
        return np.ascontiguousarray(np.stack([self.column(column) for column in columns], axis=1))

    def readings(self, columns: Sequence[str] = SAMPLE_COLUMNS) -> Array:
        """Return the samples, shape ``(n, k)``, as the sensors gave them: without the mapping's sign and offset.

        Pass them to what runs beside a machine: an exported step, a served model, the live service. Everything that
        takes recordings takes their columns, which are corrected.
        """
        samples = self.samples(columns)
        for place, column in enumerate(columns):
            if (correction := self.metadata.corrections.get(column)) is not None:
                samples[:, place] = correction.readings(samples[:, place])
        return samples

    def zeroed(self) -> Recording:
        """Return a copy with the sensors' identified zeros subtracted, and their uncertainty in the metadata."""
        who, zeros = self.metadata, self.metadata.identified_zero
        if not zeros:
            return self
        taken = {column: who.zero_offset.get(column, 0.0) + zero.offset for column, zero in zeros.items()}
        stated = {
            column: replace(who.uncertainty[column], zero=zero.uncertainty, zeroed=True)
            for column, zero in zeros.items()
        }
        metadata = replace(
            who, zero_offset={**who.zero_offset, **taken}, uncertainty={**who.uncertainty, **stated}, identified_zero={}
        )
        since_s = self.sample_time_s * np.arange(len(self))
        columns = {column: self.column(column) - zero.offset - zero.drift * since_s for column, zero in zeros.items()}
        return replace(self.with_columns(**columns), metadata=metadata)

    def lagged(self, samples: int) -> Recording:
        """Return a copy with labels delayed by ``samples``, for training with that lag; the first are not usable."""
        if samples == 0:
            return self
        before = np.maximum(np.arange(len(self)) - samples, 0)
        known = [name for name in ("friction_n", UNCERTAINTY_COLUMN) if name in self.columns]
        columns: dict[str, NDArray[Any]] = {name: self.column(name)[before] for name in known}
        usable = self.usable()[before]
        usable[:samples] = False
        return self.with_columns(**columns, usable=usable)

    def usable(self) -> Mask:
        """Return the mask of rows with a usable label, shape ``(n,)``; all rows if there is no mask."""
        if "usable" not in self.columns:
            return np.ones(len(self), dtype=np.bool_)
        return np.asarray(self.columns["usable"], dtype=np.bool_)

    def with_columns(self, **columns: NDArray[Any]) -> Recording:
        """Return a copy with columns added or replaced."""
        merged = {**self.columns, **{name: _read_only(values) for name, values in columns.items()}}
        if _CHECKED & columns.keys():
            return replace(self, columns=merged)
        derived = Recording.unchecked(self.metadata, merged)
        derived._check_shapes()
        return derived

    def rows(self, own: slice) -> Recording:
        """Return some rows, with the metadata of the whole recording; the values are not copied."""
        return Recording.unchecked(self.metadata, {name: values[own] for name, values in self.columns.items()})

    def without_columns(self, *names: str) -> Recording:
        """Return a copy without these columns; names that do not exist are ignored."""
        kept = {name: values for name, values in self.columns.items() if name not in names}
        checked = bool(_CHECKED & set(names) & self.columns.keys())
        return replace(self, columns=kept) if checked else Recording.unchecked(self.metadata, kept)


_CHECKED = {*SAMPLE_COLUMNS, DRIVE_FORCE, TIME}  # Columns whose values are checked when a recording is made


def _read_only(values: NDArray[Any] | pd.Series) -> NDArray[Any]:
    view = np.asarray(values).view()
    view.flags.writeable = False
    return view


def refuse_not_finite(where: str, samples: Array, columns: Sequence[str] = SAMPLE_COLUMNS) -> None:
    """Raise ``RecordingError`` with column and row if ``samples`` contains NaN or infinity."""
    bad = ~np.isfinite(samples)
    if bad.any():
        row, column = (int(index) for index in np.argwhere(bad)[0])
        raise RecordingError(
            f"{where}: {columns[column]} is {samples[row, column]} at row {row} "
            f"({int(bad.sum())} in all); expected finite numbers; repair or cut them before estimating"
        )


@dataclass(frozen=True)
class Signal:
    """Values of one column with the logger's stamps; columns of one table share ``time_s`` (the same object)."""

    time_s: Array  # Stamps as logged, shape ``(n,)`` [s]; they may be uneven, duplicate, decreasing or not finite
    values: Array  # Values in the column's own unit, shape ``(n,)``; NaN if a sample is missing


@dataclass(frozen=True)
class Start:
    """When a log's clock was at 0 s."""

    at: np.datetime64  # Time to the nanosecond, or the day if no time of day is stated
    utc: bool  # Whether it is UTC; otherwise it is the time of the logger's clock, whose time zone is not stated
    source: str  # Its source, in words
    dated_rows: bool = False  # Whether every row is dated, also after a restart of the clock
    midnight: np.datetime64 | None = None  # Midnight before it in the time zone of a header that states it

    @property
    def day_only(self) -> bool:
        return np.datetime_data(self.at.dtype)[0] == "D"

    def after(self, seconds: float) -> Start:
        """Return the start moved later by ``seconds``; a day without a time of day stays unchanged."""
        return self if self.day_only else replace(self, at=self.at + np.timedelta64(round(1e9 * seconds), "ns"))

    def text(self) -> str:
        """Format it in ISO 8601 to the millisecond, with Z if it is UTC; a day alone if only that is known."""
        nearest = (self.at + np.timedelta64(500, "us")).astype("datetime64[ms]")
        return str(self.at) if self.day_only else f"{nearest}{'Z' if self.utc else ''}"
