"""Convert one logger file to recordings: read, map, screen, align and check it.

A log that is too long for memory is cut into parts of some minutes. Each part is read as a separate log.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any
from unicodedata import category
from zoneinfo import ZoneInfo

import numpy as np

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.recordings.checks.limits import CheckLimits, LoadMode, StatedLoad
from cylinder_friction.recordings.checks.recording_checks import checked_recording, inspect_recording
from cylinder_friction.recordings.checks.screening import screen_signals
from cylinder_friction.recordings.columns import LOAD_FORCE, PRESSURES, TIME
from cylinder_friction.recordings.formats.cells import is_future
from cylinder_friction.recordings.formats.format import CsvOptions, LoggedTable
from cylinder_friction.recordings.formats.reading import read_logged_file
from cylinder_friction.recordings.line_loss import RECTANGULAR
from cylinder_friction.recordings.mapping.channel_mapping import (
    ChannelMapping,
    sensor_limits,
    sensor_uncertainty,
    wanted_channels,
)
from cylinder_friction.recordings.mapping.channel_words import words_of
from cylinder_friction.recordings.mapping.mapped_file import map_signals
from cylinder_friction.recordings.recording import (
    UNNAMED,
    Recording,
    RecordingError,
    RecordingMetadata,
    SensorUncertainty,
    Start,
)
from cylinder_friction.recordings.timeline.aligning import align
from cylinder_friction.recordings.timeline.timestamps import TimeRules

KEYS = (
    *("channels", "source", "truth", "pattern", "name_pattern", "load", "oil_temperature"),
    *("csv", "database", "asset", "start", "time", "checks"),
)
"""Keys of an ingest configuration."""
ROWS_AT_ONCE = 1 << 18
"""Approximate number of rows of the parts of a long log: 22 minutes at 200 Hz, 4 minutes at 1 kHz."""


START_PARTS = ("year", "month", "day", "hour", "minute", "second")


def _groups(pattern: str | None, what: str) -> Mapping[str, int]:
    try:
        return re.compile(pattern or "").groupindex
    except re.error as error:
        raise RecordingError(f"{what} {pattern!r} is not a regular expression: {error}") from None


@dataclass(frozen=True)
class NameRules:
    """How a file's path below the source states condition and session.

    ``pattern`` is a regular expression with the group ``session`` and optionally ``condition`` (by default "1"),
    ``load`` and ``asset``. None makes each file a session of its own, named as its recording.
    """

    pattern: str | None = None

    def __post_init__(self) -> None:
        groups = _groups(self.pattern, "name pattern")
        if self.pattern is not None and "session" not in groups:
            raise RecordingError(
                f"name pattern {self.pattern!r} has no group 'session'; write (?P<session>...) around the part of the "
                "path that names the session"
            )

    def names(self, relative_path: str) -> RecordingMetadata:
        """Find name, condition, session, load and machine of a file by its path relative to the source, with ``/``.

        Raises:
            RecordingError: The pattern does not match, or the name is not allowed on other systems.
        """
        if "\\" in relative_path or {"Cc", "Cs"} & set(map(category, relative_path)):
            raise RecordingError(
                f"path {relative_path!r} holds a backslash, a control character or bytes that are not UTF-8; rename "
                "the file"
            )
        name = name_of(relative_path)
        if self.pattern is None:
            return RecordingMetadata(name, "1", name, math.nan)
        match = re.search(self.pattern, relative_path)
        groups = {"condition": "1", **match.groupdict()} if match else {}
        condition, session, load, asset = (groups.get(key) or "" for key in ("condition", "session", "load", "asset"))
        if not condition or not session:
            raise RecordingError(
                f"path {relative_path!r} does not give condition and session: the pattern {self.pattern!r} finds "
                f"{'nothing in it' if match is None else groups}; rename the file, or change the "
                "pattern: name_pattern in the mapping, or --names"
            )
        return RecordingMetadata(name, condition, session, math.nan, load=load, asset=asset)


def name_of(path: str) -> str:
    """Make a recording's name from its file's path: drop the last suffix and replace ``/`` by ``-``."""
    stem = path.rsplit(".", 1)[0] if "." in path.rsplit("/", 1)[-1] else path
    return stem.replace("/", "-")


@dataclass(frozen=True)
class StartRules:
    """A mapping's rules for the start of logs."""

    zone: str | None = None  # Time zone of the logger's clock, such as Europe/Oslo, if the logs state none
    # Regular expression for the path below the source, for logs without a start. Groups: ``year`` (two or four digits),
    # ``month``, ``day``, and optionally ``hour``, ``minute`` and ``second``
    pattern: str | None = None

    def __post_init__(self) -> None:
        try:
            _ = self.zone is None or ZoneInfo(self.zone)
        except (KeyError, ValueError, OSError) as error:
            raise RecordingError(
                f"start: zone: got {self.zone!r}, expected a name of the time zone database such as Europe/Oslo"
            ) from error
        groups = _groups(self.pattern, "start: pattern").keys()
        if self.pattern is not None and not {*START_PARTS[:3]} <= groups <= {*START_PARTS}:
            raise RecordingError(
                f"start: pattern: got groups {', '.join(groups) or 'none'}, expected {', '.join(START_PARTS[:3])} and, "
                f"if the name has them, {', '.join(START_PARTS[3:])}"
            )

    def named(self, path: str) -> Start | None:
        """Read the start in a file's name; None without a date that may be one."""
        found = None if self.pattern is None else re.search(self.pattern, path)
        if found is None:
            return None
        parts = {name: int(text) for name, text in found.groupdict().items() if text}
        parts["year"] += 2000 if parts["year"] < 100 else 0
        year, month, day, hour, minute, second = (parts.get(name, 0) for name in START_PARTS)
        try:
            at = np.datetime64(f"{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}", "ns")
        except ValueError:
            return None
        words = "file name" if "hour" in parts else "file name, a date without a time of day"
        start = Start(at if "hour" in parts else at.astype("datetime64[D]"), False, words)
        return None if is_future(at) else start

    def in_utc(self, start: Start | None) -> Start | None:
        """Convert a start to UTC if the zone is known; a day, or an hour that was twice or never, stays unchanged."""
        if start is None or start.utc or self.zone is None or start.day_only:
            return start
        local, zone = start.at.astype("datetime64[us]").item(), ZoneInfo(self.zone)
        offsets = {local.replace(tzinfo=zone, fold=fold).utcoffset() for fold in (0, 1)}
        if len(offsets) > 1:
            return replace(start, source=f"{start.source}; in {self.zone} that hour was twice or never")
        at = start.at - np.timedelta64(offsets.pop(), "ns")
        return replace(start, at=at, utc=True, source=f"{start.source}, {self.zone}")


@dataclass(frozen=True)
class Recipe:
    """Settings for converting a logger's files to recordings.

    ``channels`` maps columns to channels. ``cylinder`` is the cylinder's name.
    """

    names: NameRules
    channels: Mapping[str, ChannelMapping]
    cylinder: str
    limits: CheckLimits
    csv: CsvOptions = field(default_factory=CsvOptions)
    time: TimeRules = field(default_factory=TimeRules)
    start: StartRules = field(default_factory=StartRules)
    asset: str = ""  # Name of the machine, if the files' names do not state it
    database: Path | None = None  # DBC file of the bus, for files that contain CAN frames

    @classmethod
    def from_settings(
        cls, settings: Mapping[str, Any], names: NameRules, cylinder: Cylinder, load: LoadMode | StatedLoad
    ) -> Recipe:
        """Make the recipe from an ingest configuration (``conf/ingest/*.yaml`` as nested dictionaries).

        ``settings`` contains ``channels``; other keys are optional. Recordings are checked against the cylinder's
        stroke and areas.
        """
        if unknown := sorted(settings.keys() - KEYS):
            raise RecordingError(f"mapping: key {unknown[0]!r} is not known; expected some of {', '.join(KEYS)}")
        channels = {
            column: entry if isinstance(entry, ChannelMapping) else ChannelMapping.from_dict(entry)
            for column, entry in settings["channels"].items()
        }
        channels = {column: each.for_stroke(column, cylinder.stroke_m) for column, each in channels.items()}
        steps = {column: limits.step for column, limits in sensor_limits(channels).items() if limits.step}
        limits = CheckLimits(
            cylinder.stroke_m,
            cylinder.piston_area_m2,
            cylinder.annulus_area_m2,
            "measured" if isinstance(load, StatedLoad) else load,
            steps,
            cylinder.rod_diameter_1_m,
            load if isinstance(load, StatedLoad) else None,
            **settings.get("checks", {}),
        )
        return cls(
            names=names,
            channels=channels,
            cylinder=cylinder.name,
            limits=limits,
            csv=CsvOptions(**settings.get("csv", {})),
            time=TimeRules(**settings.get("time", {})),
            start=StartRules(**settings.get("start", {})),
            asset=settings.get("asset") or "",
            database=Path(settings["database"]) if settings.get("database") else None,
        )


def open_tables(path: Path, recipe: Recipe, rows: int | None = None) -> list[LoggedTable]:
    """Read a file's tables with the mapped channels. A single table of more than ``rows`` rows is read in parts.

    If a rate is stated, channels named time are also read, to check that they do not contradict it.
    """
    read = partial(read_logged_file, path, recipe.csv, database=recipe.database, rows=rows)
    wanted = wanted_channels(recipe.channels)
    tables = read(wanted)
    unread = {name for table in tables for name in table.unread} if recipe.channels[TIME].rate_hz else set()
    clocks = {name for name in unread if words_of(name).quantity == "time"}
    return read(wanted | clocks) if clocks else tables


def metadata_of(named: RecordingMetadata, source_file: str, digest: str, recipe: Recipe) -> RecordingMetadata:
    """Add to the names of a file what else its recordings share; each has its own sample time and start."""
    stated = recipe.limits.stated_load
    areas_m2 = dict(zip(PRESSURES, recipe.limits.areas_m2 or (0.0, 0.0), strict=True))
    sensors = {column: each.sensor for column, each in recipe.channels.items() if each.sensor is not None}
    load = {} if stated is None else {LOAD_FORCE: SensorUncertainty(RECTANGULAR * stated.within_n, 0.0)}
    return replace(
        named,
        cylinder=recipe.cylinder,
        load=named.load if stated is None else stated.in_words(),
        uncertainty=load | sensor_uncertainty(recipe.channels),
        source_file=source_file,
        source_sha256=digest,
        asset=named.asset or recipe.asset,
        sensors={column: sensor.identity for column, sensor in sensors.items() if sensor.identity},
        line_loss={
            column: replace(sensor.line_loss, area_m2=areas_m2[column])
            for column, sensor in sensors.items()
            if sensor.line_loss is not None
        },
    )


def pieces_from(
    tables: Sequence[LoggedTable],
    recipe: Recipe,
    about: RecordingMetadata = UNNAMED,
    *,
    screened: bool = True,
    rows_before: int = 0,
) -> list[Recording]:
    """Map, screen and align tables. Return unbroken pieces in SI units at a constant rate, which are not checked yet.

    Without ``screened``, bad samples are kept for inspection, and only repairs of time are reported. If the tables are
    a part of a file, ``rows_before`` counts the rows above them; a clock made from a stated rate continues from there.
    """
    mapped = map_signals(tables, recipe.channels)
    signals, notes = mapped.signals, tuple[str, ...]()
    rate_hz = recipe.channels[TIME].rate_hz
    if rows_before and rate_hz is not None:
        later = {id(each.time_s): each.time_s + rows_before / rate_hz for each in signals.values()}
        signals = {name: replace(each, time_s=later[id(each.time_s)]) for name, each in signals.items()}
    if screened:
        limits = sensor_limits(recipe.channels)
        signals, bad = screen_signals(signals, limits, recipe.limits.stroke_m)
        notes = (*mapped.notes, *bad)
    pieces = align(
        signals,
        recipe.time,
        replace(about, repairs=notes),
        recipe.start.in_utc(mapped.start or recipe.start.named(about.source_file)),
    )
    if recipe.limits.stated_load is not None:
        force_n = recipe.limits.stated_load.force_n
        pieces = [each.with_columns(load_force_n=np.full(len(each), force_n)) for each in pieces]
    if len(pieces) == 1:
        return pieces
    return [each.described(name=f"{each.name}_part{number}") for number, each in enumerate(pieces, start=1)]


def pieces_of_tables(
    tables: Sequence[LoggedTable], recipe: Recipe, about: RecordingMetadata
) -> Iterator[tuple[Recording | RecordingError, str]]:
    """Yield the pieces of a file in order, each with its number among several; memory holds one part of a long file.

    A part of a long file without a piece yields its error.

    Raises:
        RecordingError: The file cannot be read, or a file that is not read in parts has no piece.
    """
    if tables[0].more is None:
        pieces = pieces_from(tables, recipe, about)
        for number, piece in enumerate(pieces, start=1):
            yield piece, f"piece {number} of {len(pieces)}" if len(pieces) > 1 else ""
        return
    number, rows, last, rules = 0, 0, "", recipe.time
    width, restarted = max(2, len(str(tables[0].parts))), False
    for part in chain(tables, tables[0].more()):
        first, rows = rows, rows + len(part.channels)
        found: Sequence[Recording | RecordingError]
        try:
            found = pieces_from([part], replace(recipe, time=rules), about, rows_before=first)
        except RecordingError as error:
            found = [RecordingError(f"in the part of rows {first + 1} to {rows}, rows counted from there: {error}")]
        for each in found:
            number += 1
            if isinstance(each, Recording):
                rules = replace(rules, rate_hz=rules.rate_hz or 1.0 / each.sample_time_s)  # the first part sets it
                restarted |= each.metadata.start < last  # an earlier start shows a restarted clock
                last = each.metadata.start
                each = each.described(name=f"{about.name}_part{number:0{width}d}")
                each = each.described(start="", start_source="") if restarted else each
            yield each, f"part {number:0{width}d}"


def checked(piece: Recording, recipe: Recipe) -> Recording:
    """Check a piece. The first check that fails raises ``RecordingError``."""
    findings = inspect_recording(piece.columns, recipe.limits, piece.sample_time_s)
    return checked_recording(piece.metadata, piece.columns, findings)
