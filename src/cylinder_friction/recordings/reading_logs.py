"""Read logger files into memory, for notebooks and scripts, by the same steps as the stage ``ingest``."""

import glob
import os
import re
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, get_args

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.files.whole_files import read_yaml
from cylinder_friction.recordings.checks.limits import LoadMode, StatedLoad
from cylinder_friction.recordings.columns import LOAD_FORCE, PRESSURES, QUANTITIES
from cylinder_friction.recordings.conversion import ROWS_AT_ONCE, NameRules, Recipe
from cylinder_friction.recordings.formats.format import LoggedTable
from cylinder_friction.recordings.formats.reading import read_logged_file
from cylinder_friction.recordings.ingesting import (
    Quarantined,
    none_usable,
    other_rates,
    overlaps_in_words,
    recordings_of,
)
from cylinder_friction.recordings.mapping.channel_mapping import SensorScale, check_mapping, check_unit, stated_rate
from cylinder_friction.recordings.mapping.guessing import GuessedMapping, channel_lines, guess_mapping, refuse_unknown
from cylinder_friction.recordings.recording import Recording, RecordingError

_PACKAGE = Path(__file__).parents[1]
FULL_SCALE_BAR = 250.0
"""Full scale assumed for a pressure sensor whose class is stated but not its range [bar]; common in hydraulics."""


def read_recordings(
    files: str | Path | Iterable[str | Path],
    channels: str | Path | Mapping[str, Any] | None,
    cylinder: Cylinder,
    *,
    names: str | None = None,
    load: LoadMode | StatedLoad | None = None,
    units: Mapping[str, str] | None = None,
    sensor_class: float | None = None,
    database: str | Path | None = None,
) -> list[Recording]:
    """Read logger files of any format as recordings, in SI units at one constant rate, sorted by path.

    Each file is read, mapped, screened, aligned and checked as in the stage ``ingest``. A file that cannot be used is
    left out with a warning that states why. ``metadata.repairs`` lists repairs.

    Args:
        files: One path, a glob such as ``"logs/**/*.csv"``, a folder (all files in it), or several of these.
        channels: Mapping of channels to columns: the path of a YAML file such as ``conf/ingest/rig.yaml`` (whose rules
            for time, spikes, zeros and checks also apply), its content as a dictionary, or only its part under
            ``channels``. None guesses the mapping from the first file, and a warning states every guess. A unit that
            no file states is guessed only if the values fit no other unit.
        cylinder: The cylinder that was recorded; recordings are checked against its stroke and areas.
        names: Regular expression for a file's path with the groups ``condition`` and ``session`` (and ``load``). By
            default the ``name_pattern`` of ``channels``. Without one, each file is a session of its own, named as the
            file, and all have the condition "1".
        load: Load of the cylinder: ``none``, ``measured`` (``load_force_n``) or ``position`` (it depends on
            position alone). By default ``position`` if ``channels`` states that load, ``measured`` if
            ``load_force_n`` is mapped, else ``none``. Or a constant load, ``StatedLoad(4218.0, within_n=40.0)``.
        units: Without ``channels``, the unit of each quantity (``pressure``, ``length``, ``time``, ``force``,
            ``temperature``) that the file does not state, such as ``{"pressure": "bar"}``.
        sensor_class: Accuracy of the pressure sensors [± % of full scale] if ``channels`` states none. Full scale is
            250 bar if their range is not stated either. None assumes nothing.
        database: DBC file of the bus, for measurement files that contain CAN frames.

    Raises:
        RecordingError: No file is found or usable, or the mapping is wrong or cannot be guessed.
        FileNotFoundError: The mapping's file does not exist.

    Example:
        >>> recordings = cf.read_recordings("data/raw/rig/*.csv", "conf/ingest/rig.yaml", cylinder)
        >>> sorted({recording.metadata.condition for recording in recordings})
        ['1', '2', '3', '4']
    """
    logs = find_logs(files, channels, cylinder, names=names, load=load, units=units, database=database)
    logs = logs.with_sensor_class(sensor_class)
    outcomes = list(recordings_of(logs.files, logs.recipe, tables=logs.tables))
    refused = [outcome for outcome in outcomes if isinstance(outcome, Quarantined)]
    recordings = [outcome for outcome in outcomes if isinstance(outcome, Recording)]
    others = other_rates([recording.metadata for recording in recordings])
    if not recordings:
        raise none_usable(logs.root.as_posix(), len(logs.files), refused[0])
    for entry in (*refused, *others.values()):
        warnings.warn(f"left out {entry.where}: {entry.reason}", stacklevel=2)
    spans = (
        (each.name, each.metadata.session, each.metadata.start, len(each) * each.sample_time_s) for each in recordings
    )
    if overlaps := overlaps_in_words(spans):
        warnings.warn(overlaps, stacklevel=2)
    return [recording for recording in recordings if recording.name not in others]


@dataclass(frozen=True)
class Logs:
    """Logger files and the recipe that converts them to recordings."""

    root: Path  # The folder that names are relative to
    files: dict[str, Path]  # Files by their paths below ``root``, sorted
    recipe: Recipe
    guessed: dict[str, Any] | None = None  # File and guesses with their reasons; None with a mapping
    assumed: str = ""  # Assumptions on sensors without a stated accuracy; empty if there are none
    tables: Mapping[str, Sequence[LoggedTable]] = field(default_factory=dict)  # Tables of files that were already read

    def with_sensor_class(self, percent: float | None) -> "Logs":
        """Assume this class of pressure sensors if their accuracy is not stated."""
        if percent is None:
            return self
        if not 0.0 < percent <= 100.0:
            raise RecordingError(f"sensor class: got {percent:g}, expected a number above 0, at most 100 (% of range)")
        channels, assumed = dict(self.recipe.channels), list[str]()
        for column in PRESSURES:
            if column not in channels or ((sensor := channels[column].sensor) and sensor.accuracy_percent is not None):
                continue
            sensor = sensor or SensorScale((0.0, FULL_SCALE_BAR), "bar")
            channels[column] = replace(channels[column], sensor=replace(sensor, accuracy_percent=percent))
            assumed.append(f"{column} ± {percent:g} % of {sensor.full_scale:g} {sensor.unit}")
        words = f"assumed, not stated: {', '.join(assumed)}" if assumed else ""
        return replace(self, recipe=replace(self.recipe, channels=channels), assumed=words)


def find_logs(
    files: str | Path | Iterable[str | Path],
    channels: str | Path | Mapping[str, Any] | None,
    cylinder: Cylinder,
    *,
    names: str | None = None,
    load: LoadMode | StatedLoad | None = None,
    rate_hz: float | None = None,
    units: Mapping[str, str] | None = None,
    database: str | Path | None = None,
) -> Logs:
    """Find the files and the recipe for reading them. The first file is read only if the mapping must be guessed.

    Arguments and errors are those of ``read_recordings``. ``rate_hz`` is the rate of the recordings [Hz]; by default
    the rate in ``channels``, or each file's own rate.
    """
    paths = log_paths([files] if isinstance(files, str | Path) else list(files))
    try:
        if channels is None:
            guess, tables = _guessed(paths[0], cylinder, units or {}, None if database is None else Path(database))
            settings = {"channels": {name: guess.entry(name) for name in guess.columns}, "database": database}
            logs = _logs(paths, settings, cylinder, names, load, rate_hz)
            read = {name: tables for name, path in logs.files.items() if path == paths[0]}
            return replace(logs, guessed={"from": paths[0].name, "columns": guess.to_dict()}, tables=read)
        if units:
            raise RecordingError(
                f"units: got {dict(units)} beside a mapping; state them in the mapping, or leave it out"
            )
        settings = dict(_settings(channels)) | ({"database": database} if database else {})
        return _logs(paths, settings, cylinder, names, load, rate_hz)
    except (TypeError, AttributeError) as error:
        where = channels if isinstance(channels, str | Path) else "channels"
        raise RecordingError(
            f"{where}: is no mapping of channels to columns with rules ({error}); `cylinder-friction ingest init FILE` "
            "writes one"
        ) from error


def _guessed(
    path: Path, cylinder: Cylinder, units: Mapping[str, str], database: Path | None
) -> tuple[GuessedMapping, list[LoggedTable]]:
    """Guess a mapping from a log and warn of every guess; also return the log's tables, unless it has parts."""
    for quantity, unit in units.items():
        column = next((column for column in QUANTITIES if QUANTITIES[column] == quantity), None)
        if column is None:
            known = ", ".join(dict.fromkeys(QUANTITIES.values()))
            raise RecordingError(f"units: got {quantity!r}, expected one of {known}, such as pressure=bar")
        if quantity != "time" or stated_rate(unit) is None:
            check_unit(column, unit)
    try:
        tables = read_logged_file(path, database=database, rows=ROWS_AT_ONCE)
        guess = guess_mapping(tables, path, cylinder, units)
        refuse_unknown(guess, units)
    except RecordingError as error:
        raise RecordingError(f"{path}: {error}") from error
    lines = "\n".join(channel_lines(guess))
    warnings.warn(f"no mapping was given; guessed from {path.name}:\n{lines}", stacklevel=4)
    return guess, [] if tables[0].more else tables


def _logs(
    paths: Sequence[Path],
    settings: Mapping[str, Any],
    cylinder: Cylinder,
    names: str | None,
    load: LoadMode | StatedLoad | None,
    rate_hz: float | None,
) -> Logs:
    if rate_hz is not None:
        settings = {**settings, "time": {**settings.get("time", {}), "rate_hz": rate_hz}}
    root = _root(paths, settings.get("source"))
    files = {Path(os.path.relpath(path, root)).as_posix(): path for path in paths}
    rules = NameRules(names or settings.get("name_pattern"))
    if not names and rules.pattern is not None and not any(re.search(rules.pattern, file) for file in files):
        words = f"name_pattern {rules.pattern!r} of the mapping finds no session in any path, such as"
        rules = NameRules()
        warnings.warn(f"{words} {next(iter(files))!r}: each file is a session of its own", stacklevel=4)
    mode: LoadMode = "measured" if LOAD_FORCE in settings["channels"] else "none"
    mapped = settings.get("load")
    if mapped not in (None, *get_args(LoadMode)):
        load = load or StatedLoad.parsed(str(mapped))
    if isinstance(load, StatedLoad) and mode == "measured":
        raise RecordingError(f"load: {load.force_n:g} N is stated, but {LOAD_FORCE} is mapped too; leave one out")
    mode = "position" if mapped == "position" else mode
    recipe = Recipe.from_settings(settings, rules, cylinder, load or mode)
    check_mapping(recipe.channels)
    return Logs(root, files, recipe)


def log_paths(files: Sequence[str | Path]) -> list[Path]:
    """List the files named by paths, folders and patterns, sorted; raise ``RecordingError`` if one names no file."""
    found: set[Path] = set()
    for file in files:
        path = Path(file)
        if path.is_dir():
            matching = [inner for inner in path.rglob("*") if inner.is_file() and not inner.name.startswith(".")]
        else:
            named = [path] if path.exists() else map(Path, glob.glob(str(file), recursive=True))  # noqa: PTH207
            matching = [each for each in named if each.is_file()]
        if not matching:
            problem = "no such file, and no file matches it as a pattern; correct the path"
            if path.exists():
                empty = "is an empty folder; expected logs in it"
                problem = empty if path.is_dir() else "is no regular file; copy what comes from it into one"
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
    places = (path.parent, _PACKAGE / "project/conf/ingest", _PACKAGE.parents[1] / "conf/ingest")
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
