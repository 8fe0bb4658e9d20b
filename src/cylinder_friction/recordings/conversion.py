"""From one logger file to recordings: read, map, screen, align, zero, check."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.recordings.checks.limits import CheckLimits, LoadMode
from cylinder_friction.recordings.checks.recording_checks import checked_recording, inspect_recording
from cylinder_friction.recordings.checks.screening import ScreenRules, screen_signals
from cylinder_friction.recordings.columns import TIME
from cylinder_friction.recordings.formats.layout import CsvOptions
from cylinder_friction.recordings.formats.logged_table import LoggedTable, LongTable
from cylinder_friction.recordings.formats.reading import open_logged_file
from cylinder_friction.recordings.mapping.calibration import ZeroReading, ZeroRules, apply_zero, find_zero
from cylinder_friction.recordings.mapping.channel_mapping import ChannelMapping, sensor_limits, wanted_channels
from cylinder_friction.recordings.mapping.channel_words import words_of
from cylinder_friction.recordings.mapping.mapped_file import map_signals
from cylinder_friction.recordings.path_names import NameRules, PathNames
from cylinder_friction.recordings.recording import Columns, Recording, RecordingMetadata, RecordingPiece
from cylinder_friction.recordings.start_rules import StartRules
from cylinder_friction.recordings.timeline.aligning import align
from cylinder_friction.recordings.timeline.timestamps import TimeRules


@dataclass(frozen=True)
class Recipe:
    """How a logger's file becomes recordings.

    ``channels`` are by column, ``cylinder`` is its name, ``file_format`` is one of ``formats.registry.SETTINGS``, or
    ``auto``, which looks into the file.
    """

    names: NameRules
    channels: Mapping[str, ChannelMapping]
    cylinder: str
    limits: CheckLimits
    file_format: str = "auto"
    csv: CsvOptions = field(default_factory=CsvOptions)
    screen: ScreenRules = field(default_factory=ScreenRules)
    time: TimeRules = field(default_factory=TimeRules)
    zero: ZeroRules = field(default_factory=ZeroRules)
    start: StartRules = field(default_factory=StartRules)
    asset: str = ""  # The machine, where the files' names do not state it
    database: Path | None = None  # Of a bus (DBC), which files of its frames are decoded with

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any], names: NameRules, cylinder: Cylinder, load: LoadMode) -> Recipe:
        """Return the recipe of an ingest configuration, ``conf/ingest/*.yaml`` as nested dictionaries.

        ``settings`` holds ``channels``, and where they differ from the defaults ``format``, ``csv``, ``time``,
        ``screen``, ``zero``, ``start``, ``asset``, ``database`` and ``checks``. Recordings are checked against the
        cylinder's stroke and areas.
        """
        channels = {
            column: entry if isinstance(entry, ChannelMapping) else ChannelMapping.from_dict(entry)
            for column, entry in settings["channels"].items()
        }
        channels = {column: each.for_stroke(column, cylinder.stroke_m) for column, each in channels.items()}
        steps = {column: limits.step for column, limits in sensor_limits(channels).items() if limits.step}
        areas_m2 = (cylinder.piston_area_m2, cylinder.annulus_area_m2)
        return cls(
            names=names,
            channels=channels,
            cylinder=cylinder.name,
            limits=CheckLimits(cylinder.stroke_m, *areas_m2, load, steps, **settings.get("checks", {})),
            file_format=settings.get("format", "auto"),
            csv=CsvOptions(**settings.get("csv", {})),
            screen=ScreenRules(**settings.get("screen", {})),
            time=TimeRules(**settings.get("time", {})),
            zero=ZeroRules(**settings.get("zero", {})),
            start=StartRules(**settings.get("start", {})),
            asset=settings.get("asset") or "",
            database=Path(settings["database"]) if settings.get("database") else None,
        )


def open_tables(path: Path, recipe: Recipe, rows: int | None = None) -> LongTable | list[LoggedTable]:
    """Open a file's tables with the mapped channels. A table of more ``rows`` is to be read in parts of so many.

    If a stated rate takes the place of time, what is called time is read too, for it must not contradict that rate.
    """
    read = partial(open_logged_file, path, rows, recipe.file_format, recipe.csv, database=recipe.database)
    wanted = wanted_channels(recipe.channels)
    tables = read(wanted)
    if recipe.channels["time_s"].rate_hz is None:
        return tables
    first = [next(tables.chunks())] if isinstance(tables, LongTable) else tables
    clocks = {name for table in first for name in table.unread if words_of(name).quantity == "time"}
    return read(wanted | clocks) if clocks else tables


def pieces_of(path: Path, recipe: Recipe, *, screened: bool = True) -> list[RecordingPiece]:
    """Read the unbroken stretches of a file in SI units, each at one constant rate, with all that was repaired.

    If not ``screened``, bad samples stay where they are, to be looked at, and only repairs of time are stated.
    """
    tables = open_tables(path, recipe)
    assert not isinstance(tables, LongTable)
    return pieces_from(tables, recipe, screened=screened)


def pieces_from(
    tables: Sequence[LoggedTable], recipe: Recipe, *, screened: bool = True, rows_before: int = 0
) -> list[RecordingPiece]:
    """Map, screen and align tables that are read already; see ``pieces_of``.

    ``rows_before`` counts the rows of the file above the tables, if they are a part of it. A clock that is a stated
    rate runs on from there.
    """
    mapped = map_signals(tables, recipe.channels)
    signals, notes = mapped.signals, tuple[str, ...]()
    rate_hz = recipe.channels[TIME].rate_hz
    if rows_before and rate_hz is not None:
        later = {id(each.time_s): each.time_s + rows_before / rate_hz for each in signals.values()}
        signals = {name: replace(each, time_s=later[id(each.time_s)]) for name, each in signals.items()}
    if screened:
        limits = sensor_limits(recipe.channels)
        signals, bad = screen_signals(signals, limits, recipe.screen, recipe.limits.stroke_m)
        notes = (*mapped.notes, *bad)
    pieces = align(signals, recipe.time)
    return [replace(piece, repairs=(*notes, *piece.repairs), start=mapped.start) for piece in pieces]


def metadata_of(
    piece: RecordingPiece, names: PathNames, suffix: str, source_file: str, digest: str, recipe: Recipe
) -> RecordingMetadata:
    """Return the metadata of one piece. ``suffix`` is what its name has beyond that of its file, such as ``_part2``."""
    stated = piece.start if piece.start is None or piece.segment == 0 or piece.start.dated_rows else None
    start = recipe.start.of(stated, source_file)
    sensors = {column: each.sensor.identity for column, each in recipe.channels.items() if each.sensor is not None}
    return RecordingMetadata(
        name=f"{names.name}{suffix}",
        condition=names.condition,
        session=names.session,
        sample_time_s=piece.sample_time_s,
        cylinder=recipe.cylinder,
        load=names.load,
        source_file=source_file,
        source_sha256=digest,
        start="" if start is None else start.after(float(piece.columns[TIME][0])).text(),
        start_source="" if start is None else start.source,
        asset=names.asset or recipe.asset,
        sensors={column: known for column, known in sensors.items() if known},
        repairs=piece.repairs,
    )


def part_suffix(number: int, parts: int, width: int = 1) -> str:
    """Return how the name of one of several parts of a file ends; empty if there is only one."""
    return f"_part{number:0{width}d}" if parts > 1 else ""


def zeroed(
    piece: RecordingPiece, metadata: RecordingMetadata, recipe: Recipe, session: ZeroReading | None = None
) -> tuple[Columns, RecordingMetadata]:
    """Return a piece's columns with the zeros of its pressure sensors taken off, and metadata that record it.

    The zeros of its ``session`` are for a piece that shows none itself; a stated window without vented chambers is
    refused.
    """
    own = find_zero(piece.columns, recipe.zero, recipe.channels, metadata.name)
    # If neither shows a zero, the recording's own reason is more specific than the session's.
    if session is not None and session.offsets and not own.offsets:
        own = session
    return apply_zero(piece.columns, metadata, own, recipe.channels)


def checked(
    piece: RecordingPiece, metadata: RecordingMetadata, recipe: Recipe, session: ZeroReading | None = None
) -> Recording:
    """Zero a piece's pressures and check it. The first check that it does not pass raises ``RecordingError``."""
    columns, with_zero = zeroed(piece, metadata, recipe, session)
    return checked_recording(with_zero, columns, inspect_recording(columns, recipe.limits, piece.sample_time_s))
