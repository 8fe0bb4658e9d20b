"""What became of logs: of each recording, of each refused file, and of all of them."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from cylinder_friction.evaluation.friction_levels import FrictionLevel, RecordingDifference, differences
from cylinder_friction.labelling.known_offset import KnownOffset
from cylinder_friction.recordings.ingesting import Quarantined


@dataclass(frozen=True)
class FrictionOfRecording:
    """What became of one recording; friction itself is in its file."""

    name: str
    source_file: str
    source_sha256: str
    session: str
    rows: int
    duration_s: float
    usable_percent: float  # Of the rows; not near end stops or edges, whose force balance is not friction alone
    # Half of extending less retracting at equal positions [N]; None if the piston passed none both ways
    friction_n: float | None
    flags_percent: dict[str, float] | None  # Of the rows, by name of the estimator's flag; None without an estimator
    load: str  # Which load was taken off, in words
    # Why the estimates are not to be used as they are, and what else is unlike training; empty if nothing is
    not_known: str
    unlike_training: str
    load_left_n: float | None  # A load that friction still holds, about [N]; None if nothing hints at one
    repairs: tuple[str, ...]  # What reading had to repair
    condition: str = ""
    asset: str = ""  # The machine, if it is stated
    # When its first sample was taken, as in ``RecordingMetadata``, and what states that; empty if nothing does
    start: str = ""
    start_source: str = ""
    # Serial number and day of calibration of the sensor behind a column, if they are stated
    sensors: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    levels: tuple[FrictionLevel, ...] = ()  # Friction of steady sliding at each level of pressure and speed
    gone: str = ""  # That its file was not among the logs of the last run, in words; empty if it was

    def to_dict(self) -> dict[str, Any]:
        """Return the content as JSON-compatible values."""
        return {**vars(self), "levels": [dict(vars(each)) for each in self.levels]}


@dataclass(frozen=True)
class FrictionOfLogs:
    """What became of the logs."""

    folder: Path  # Where the files lie
    bounds: str  # What ``lower_n`` and ``upper_n`` are
    recordings: list[FrictionOfRecording] = field(default_factory=list)
    refused: list[Quarantined] = field(default_factory=list)
    offsets: list[KnownOffset] = field(default_factory=list)
    new: tuple[str, ...] = ()  # Names of the recordings that this call processed; the others are of earlier ones
    news: tuple[str, ...] = ()  # What is new, gone or left for the next run, if an earlier one was continued
    # By what the results depend on beside the logs (cylinder, mapping, model, version of the code): its SHA-256
    depends_on: Mapping[str, str] = field(default_factory=dict)
    # From which file channels and units were guessed, and each column's with its reasons; None with a mapping
    guessed: dict[str, Any] | None = None
    loss: str = ""  # What looks like a loss between sensors and cylinder, in words; empty if nothing does

    @property
    def levels(self) -> dict[str, tuple[FrictionLevel, ...]]:
        """Friction of steady sliding at each level of pressure and speed, by recording."""
        return {each.name: each.levels for each in self.recordings}

    @cached_property
    def differences(self) -> tuple[RecordingDifference, ...]:
        """By how much recordings differ from each other, and what is left of it at equal pressures and speed."""
        return differences(self.levels)

    def to_dict(self) -> dict[str, Any]:
        """Return the content as JSON-compatible values; what is not known is None."""
        return {
            "folder": self.folder.as_posix(),
            "bounds": self.bounds,
            "recordings": [each.to_dict() for each in self.recordings],
            "refused": [asdict(each) for each in self.refused],
            "offsets": [{name: known_number(value) for name, value in asdict(each).items()} for each in self.offsets],
            "differences": [asdict(each) for each in self.differences],
            "new": list(self.new),
            "depends_on": dict(self.depends_on),
            "news": list(self.news),
            "guessed": self.guessed,
            "loss": self.loss,
        }


def remarks(each: FrictionOfRecording) -> list[str]:
    """List what is worth knowing of a recording beside its numbers."""
    flags = [f"{share:.1f} % {name}" for name, share in (each.flags_percent or {}).items()]
    left = load_left(each)
    gone = [each.gone] if each.gone else []
    unlike = [f"not to be used as it is: {each.not_known}"] if each.not_known else []
    unlike += [each.unlike_training] if each.unlike_training else []
    return [
        *gone,
        *unlike,
        *([left] if left else []),
        *([] if each.load == "none" else [f"load: {each.load}"]),
        *flags,
        *each.repairs,
    ]


def load_left(each: FrictionOfRecording) -> str:
    """Return what load friction still holds, and what to do; empty if nothing hints at one."""
    if each.load_left_n is None:
        return ""
    remedy = "map a load cell, use --load position, zero the sensors, or state a second rod (rod_diameter_1_m)"
    return f"friction_n holds a load, or a sensor's zero, of about {each.load_left_n:.0f} N; {remedy}"


def table_rows(result: FrictionOfLogs) -> list[tuple[str, str, float | None, str, str]]:
    """Return name, start, friction [N], usable share and remarks of every recording and refused file."""
    rows = [
        (each.name, each.start, each.friction_n, f"{each.usable_percent:.0f}", "; ".join(remarks(each)))
        for each in result.recordings
    ]
    return rows + [(each.where, "", None, "", f"refused: {each.reason}") for each in result.refused]


def known_number(value: Any) -> Any:
    """Return None for a number that is not known."""
    return None if isinstance(value, float) and not math.isfinite(value) else value
