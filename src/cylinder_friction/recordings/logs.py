"""The logger files of a run, and the recipe that converts them to recordings."""

from __future__ import annotations

import glob
import math
import os
import re
import warnings
from collections.abc import Iterable, Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any
from unicodedata import category
from zoneinfo import ZoneInfo

import numpy as np

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.files.result_folder import existing
from cylinder_friction.files.whole_files import read_yaml
from cylinder_friction.recordings.checks.limits import (
    CheckLimits,
    CheckRules,
    GivenLoad,
    Load,
    LoadMode,
    StatedLoad,
    load_of,
)
from cylinder_friction.recordings.columns import LOAD_FORCE, PRESSURES, QUANTITIES
from cylinder_friction.recordings.formats.cells import is_future
from cylinder_friction.recordings.formats.format import CsvOptions, LoggedTable
from cylinder_friction.recordings.formats.reading import read_logged_file
from cylinder_friction.recordings.line_loss import BAR_PA
from cylinder_friction.recordings.mapping.channel_mapping import (
    ChannelMapping,
    SensorScale,
    check_mapping,
    check_unit,
    sensor_limits,
    stated_rate,
)
from cylinder_friction.recordings.mapping.guessing import GuessedMapping, guess_mapping
from cylinder_friction.recordings.mapping.mapping_text import channel_lines, refuse_unknown
from cylinder_friction.recordings.recording import RecordingError, RecordingMetadata, Start
from cylinder_friction.recordings.timeline.timestamps import TimeRules
from cylinder_friction.wording import printable

_PACKAGE = Path(__file__).parents[1]
KEYS = (
    *("channels", "source", "truth", "pattern", "name_pattern", "load", "oil_temperature"),
    *("csv", "database", "asset", "start", "time", "checks"),
)
"""Keys of an ingest configuration."""
ROWS_AT_ONCE = 1 << 18  # Approximate rows of the parts of a long log: 22 minutes at 200 Hz, 4 minutes at 1 kHz
FULL_SCALE_BAR = 250.0
"""Full scale assumed for a pressure sensor whose class is stated but not its range [bar]; common in hydraulics."""
START_PARTS = ("year", "month", "day", "hour", "minute", "second")


def _groups(pattern: str | None, what: str) -> Mapping[str, int]:
    try:
        return re.compile(pattern or "").groupindex
    except re.error as error:
        raise RecordingError(f"{what} {pattern!r} is not a regular expression: {error}") from None


@dataclass(frozen=True)
class NameRules:
    """How a file's path states session, and perhaps condition, load and asset: by the groups of ``pattern``."""

    pattern: str | None = None

    def __post_init__(self) -> None:
        groups = _groups(self.pattern, "name pattern")
        if self.pattern is not None and "session" not in groups:
            raise RecordingError(
                f"name pattern {self.pattern!r} has no group 'session'; write (?P<session>...) around the session"
            )

    def names(self, relative_path: str) -> RecordingMetadata:
        """Find name, condition, session, load and machine of a file by its path relative to the source, with ``/``."""
        if "\\" in relative_path or {"Cc", "Cs"} & set(map(category, relative_path)):
            raise RecordingError(
                f"path {relative_path!r} holds a backslash, a control character or bytes that are not UTF-8; rename it"
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
    return re.sub(r"\.[^./]*\Z", "", path).replace("/", "-")


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
    """Settings for converting a logger's files to recordings. ``channels`` maps columns to channels."""

    names: NameRules
    channels: Mapping[str, ChannelMapping]
    limits: CheckLimits
    csv: CsvOptions = field(default_factory=CsvOptions)
    time: TimeRules = field(default_factory=TimeRules)
    start: StartRules = field(default_factory=StartRules)
    asset: str = ""  # Name of the machine, if the files' names do not state it
    database: Path | None = None  # DBC file of the bus, for files that contain CAN frames

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any], names: NameRules, cylinder: Cylinder, load: Load) -> Recipe:
        """Make the recipe from an ingest configuration with ``channels`` and optional other keys."""
        kinds: dict[str, Any] = {"csv": CsvOptions, "time": TimeRules, "start": StartRules, "checks": CheckRules}
        given_rules = {name: settings.get(name, {}) for name in kinds}
        known_keys = [(settings, KEYS), *((given_rules[name], vars(own())) for name, own in kinds.items())]
        for each in (own for own in settings["channels"].values() if isinstance(own, Mapping)):
            known_keys += [(each, vars(ChannelMapping("a"))), (each.get("sensor") or {}, vars(SensorScale()))]
        for given, known in known_keys:
            if unknown := sorted(given.keys() - known):
                raise RecordingError(f"mapping: key {unknown[0]!r} is not known; expected some of {', '.join(known)}")
        channels = {
            column: entry if isinstance(entry, ChannelMapping) else ChannelMapping.from_dict(entry)
            for column, entry in settings["channels"].items()
        }
        channels = {column: each.for_stroke(column, cylinder.stroke_m) for column, each in channels.items()}
        steps = {column: limits.step for column, limits in sensor_limits(channels).items() if limits.step}
        stated = load if isinstance(load, StatedLoad) else None
        mode: LoadMode = "measured" if isinstance(load, StatedLoad) else load
        limits = CheckLimits(cylinder, mode, steps, stated, **given_rules.pop("checks"))
        rules = {name: kinds[name](**given) for name, given in given_rules.items()}
        database = Path(settings["database"]) if settings.get("database") else None
        return cls(names, channels, limits, **rules, asset=settings.get("asset") or "", database=database)


@dataclass(frozen=True)
class Logs:
    """Logger files and the recipe that converts them to recordings."""

    root: Path  # The folder that names are relative to
    files: dict[str, Path]  # Files by their paths below ``root``, sorted
    recipe: Recipe
    guessed: dict[str, Any] | None = None  # File and guesses with their reasons; None with a mapping
    assumed: str = ""  # Assumptions on sensors without a stated accuracy; empty if there are none
    tables: Mapping[str, Sequence[LoggedTable]] = field(default_factory=dict)  # Tables of files that were already read
    inputs: tuple[Path, ...] = ()  # Everything that was read or is to be read: files, folders and mapping

    def with_sensor_class(self, percent: float | None) -> Logs:
        """Assume this class of pressure sensors and load cell if their accuracy is not stated.

        A load cell without a stated range is assumed to read what the piston exerts at ``FULL_SCALE_BAR``, either way.
        """
        if percent is None:
            return self
        if not 0.0 < percent <= 100.0:
            raise RecordingError(f"sensor class: got {percent:g}, expected a number above 0, at most 100 (% of range)")
        channels, assumed = dict(self.recipe.channels), list[str]()
        piston_n = BAR_PA * FULL_SCALE_BAR * self.recipe.limits.cylinder.piston_area_m2
        for column in (*PRESSURES, LOAD_FORCE):
            sensor = channels[column].sensor or SensorScale() if column in channels else None
            if sensor is None or sensor.accuracy_percent is not None:
                continue
            own_percent, full_scale = percent, f"{sensor.full_scale:g} {sensor.unit}"
            if not sensor.unit and column == LOAD_FORCE:
                sensor = replace(sensor, range=(-piston_n, piston_n), unit="N")
                own_percent = percent / 2.0  # the range is twice the full scale, as it has both signs
                full_scale = f"{piston_n:.0f} N (what the piston exerts at {FULL_SCALE_BAR:g} bar)"
            elif not sensor.unit:
                sensor = replace(sensor, range=(0.0, FULL_SCALE_BAR), unit="bar")
                full_scale = f"{FULL_SCALE_BAR:g} bar"
            channels[column] = replace(channels[column], sensor=replace(sensor, accuracy_percent=own_percent))
            assumed.append(f"{column} ± {percent:g} % of {full_scale}")
        words = f"assumed, not stated: {', '.join(assumed)}" if assumed else ""
        return replace(self, recipe=replace(self.recipe, channels=channels), assumed=words)


def find_logs(
    files: str | Path | Iterable[str | Path],
    channels: str | Path | Mapping[str, Any] | None,
    cylinder: Cylinder,
    *,
    names: str | None = None,
    load: GivenLoad | None = None,
    rate_hz: float | None = None,
    units: Mapping[str, str] | None = None,
    sensor_class: float | None = None,
    database: str | Path | None = None,
) -> Logs:
    """Find the files and the recipe; the first file that can be read is read if the mapping must be guessed."""
    given = [files] if isinstance(files, str | Path) else list(files)
    mapping = channels if isinstance(channels, str | Path) else None
    paths, guess, tables = log_paths(given), None, list[LoggedTable]()
    stated = None if load is None else load_of(load)
    try:
        if channels is None:
            guess, tables = _guessed(paths, cylinder, units or {}, Path(database) if database else None, stated)
            settings: dict[str, Any] = {"channels": {name: each.entry for name, each in guess.columns.items()}}
        elif units:
            raise RecordingError(
                f"units: got {dict(units)} beside a mapping; state them in the mapping, or leave it out"
            )
        else:
            settings = dict(_settings(channels))
        if database:
            settings["database"] = database
        if rate_hz is not None:
            settings["time"] = {**settings.get("time", {}), "rate_hz": rate_hz}
        logs = _logs(paths, settings, cylinder, names, stated)
    except (TypeError, AttributeError) as error:
        raise RecordingError(
            f"{mapping or 'channels'}: is no mapping of channels to columns with rules ({error}); see `ingest init`"
        ) from error
    return replace(
        logs.with_sensor_class(sensor_class),
        guessed=None if guess is None else {"from": printable(guess.path.name), "columns": guess.to_dict()},
        tables={name: tables for name, path in logs.files.items() if guess is not None and path == guess.path},
        inputs=(*existing([*given, mapping]), *paths),
    )


def _guessed(
    paths: Sequence[Path], cylinder: Cylinder, units: Mapping[str, str], database: Path | None, load: Load | None
) -> tuple[GuessedMapping, list[LoggedTable]]:
    """Guess a mapping from the first log that can be read, and warn; also return its tables, unless it has parts."""
    for quantity, unit in units.items():
        column = next((column for column in QUANTITIES if QUANTITIES[column] == quantity), None)
        if column is None:
            known = ", ".join(dict.fromkeys(QUANTITIES.values()))
            raise RecordingError(f"units: got {quantity!r}, expected one of {known}, such as pressure=bar")
        if quantity != "time" or stated_rate(unit) is None:
            check_unit(column, unit)
    read = partial(read_logged_file, database=database, rows=ROWS_AT_ONCE)
    try:
        for path in paths:
            with nullcontext() if path == paths[-1] else suppress(RecordingError):
                tables = read(path)
                break
        guess = guess_mapping(tables, path, cylinder, units)
        if load not in (None, "measured"):
            guess = replace(guess, columns={name: each for name, each in guess.columns.items() if name != LOAD_FORCE})
        refuse_unknown(guess, units)
    except RecordingError as error:
        raise RecordingError(f"{printable(str(path))}: {error}") from error
    lines = "\n".join(channel_lines(guess))
    warnings.warn(f"no mapping was given; guessed from {path.name}:\n{lines}", stacklevel=4)
    return guess, [] if tables[0].more else tables


def _logs(
    paths: Sequence[Path], settings: Mapping[str, Any], cylinder: Cylinder, names: str | None, load: Load | None
) -> Logs:
    root = _root(paths, settings.get("source"))
    files = {Path(os.path.relpath(path, root)).as_posix(): path for path in paths}
    rules = NameRules(names or settings.get("name_pattern"))
    nothing = f"of the mapping finds nothing in any path, such as {next(iter(files))!r}"
    if not names and rules.pattern is not None and not any(re.search(rules.pattern, file) for file in files):
        own = "each file is a session of its own; correct it, or state another by --names"
        warnings.warn(f"name_pattern '{rules.pattern}' {nothing}: {own}", stacklevel=4)
        rules = NameRules()
    mode: LoadMode = "measured" if LOAD_FORCE in settings["channels"] else "none"
    mapped = settings.get("load")
    if load is None:
        load = mode if mapped in (None, "none", "measured") else load_of(mapped)
    if isinstance(load, StatedLoad) and mode == "measured":
        raise RecordingError(f"load: {load.force_n:g} N is stated, but {LOAD_FORCE} is mapped too; leave one out")
    recipe = Recipe.from_settings(settings, rules, cylinder, load)
    check_mapping(recipe.channels)
    if (pattern := recipe.start.pattern) is not None and not any(map(recipe.start.named, files)):
        warnings.warn(f"start.pattern '{pattern}' {nothing}, so that it states no start; correct it", stacklevel=4)
        recipe = replace(recipe, start=replace(recipe.start, pattern=None))
    return Logs(root, files, recipe)


def log_paths(files: Sequence[str | Path]) -> list[Path]:
    """List the files named by paths, folders and patterns, sorted; raise ``RecordingError`` if one names no file.

    Pipes and links to nothing are among them, because whoever reads a file refuses those by name.
    """
    found: set[Path] = set()
    for file in files:
        path, problem = Path(file), ""
        named: Iterable[Path] = [path]
        if path.is_dir():
            named, problem = path.rglob("[!.]*"), "is an empty folder; expected logs in it"
        elif not path.exists():
            named = map(Path, glob.glob(str(file), recursive=True))  # noqa: PTH207
            problem = "no such file, and no file matches it as a pattern; correct the path"
        matching = [each for each in named if not each.is_dir()]
        if not matching:
            raise RecordingError(f"{file}: {problem}")
        found.update(matching)
    if not found:
        raise RecordingError("no logger file was given; expected a path, a pattern or a folder, or several of these")
    return sorted(found)


def _root(paths: Sequence[Path], source: str | None) -> Path:
    """Find the folder that names are relative to: the configured one if all files are in it, else the common one."""
    absolute = [Path(os.path.abspath(path)) for path in paths]  # noqa: PTH100 - without "..", links as they are
    if source is not None and all(path.is_relative_to(os.path.abspath(source)) for path in absolute):  # noqa: PTH100
        return Path(source)
    return Path(os.path.commonpath([path.parent for path in absolute]))


def _settings(channels: str | Path | Mapping[str, Any]) -> Mapping[str, Any]:
    if isinstance(channels, str | Path):
        settings = load_settings(Path(channels))
        if not isinstance(settings.get("channels"), dict):
            raise RecordingError(
                f"{channels}: expected a key 'channels' with one entry per column, but got "
                f"{', '.join(settings) or 'none'}; `cylinder-friction ingest init FILE` writes such a file"
            )
        return settings
    return channels if "channels" in channels else {"channels": channels}


def load_settings(path: Path) -> dict[str, Any]:
    """Read an ingest configuration as nested dictionaries, merged with the files under its ``defaults``."""
    own, settings = read_yaml(path), dict[str, Any]()
    # As no path from here: a stage depends on the files that its modules name so, but has its mapping from params.yaml
    shipped = (f"{_PACKAGE}/project/conf/ingest", f"{_PACKAGE.parents[1]}/conf/ingest")
    places = (path.parent, *map(Path, shipped))
    for entry in own.pop("defaults", []):
        for group, name in (entry if isinstance(entry, dict) else {"": entry}).items():
            if name != "_self_":  # beside the mapping, or from this package
                below = [place / group.partition("@")[0] / f"{name}.yaml" for place in places]
                _merge(settings, load_settings(next(filter(Path.is_file, below), below[0])))
    _merge(settings, own)
    return settings


def _merge(settings: dict[str, Any], more: Mapping[str, Any]) -> None:
    for key, value in more.items():
        if isinstance(value, dict) and isinstance(settings.get(key), dict):
            _merge(settings[key], value)
        else:
            settings[key] = value
