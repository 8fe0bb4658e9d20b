"""The command ``estimate``: from logger files to files of friction and a page, with or without a trained model.

What work needs is imported when it begins, so that help and mistyped options come at once.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
import warnings
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import MISSING, fields
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, get_args

from cylinder_friction.commands._model import model_folder

if TYPE_CHECKING:
    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.estimation.identification import FrictionModels
    from cylinder_friction.estimation.results import FrictionOfLogs
    from cylinder_friction.recordings.checks.limits import LoadMode
    from cylinder_friction.recordings.stated_load import StatedLoad

EXPECTED = (ValueError, OSError)
EXAMPLE_CYLINDER = "bore_diameter_m=0.063,rod_diameter_m=0.028,stroke_m=0.25,moving_mass_kg=6"
FEW_FILES = 200
"""Fewer logs are read before other processes would have begun."""
Result = TypeVar("Result")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_log_arguments(parser, "friction")
    parser.add_argument(
        "--model", help="folder of a saved estimator, or models:/NAME@ALIAS; default: none, the off-line label"
    )
    words = "use a model that was trained for another cylinder, which is refused otherwise"
    parser.add_argument("--other-cylinder", action="store_true", help=words)
    words = f"number of processes; default: one per core for {FEW_FILES} logs or more, else one"
    parser.add_argument("--workers", type=int, metavar="N", help=words)
    words = "format of the results; csv: a file beside each Parquet file; default: parquet"
    parser.add_argument("--format", choices=("parquet", "csv"), default="parquet", help=words)


def add_log_arguments(parser: argparse.ArgumentParser, folder: str) -> None:
    """Add what every command on logger files takes; without ``--output`` it writes ``folder``."""
    parser.add_argument("logs", nargs="+", metavar="LOGS", help="files, folders or patterns, of any supported format")
    add_reading_arguments(parser)
    words = f"folder to write; default: {folder}"
    parser.add_argument("--output", "--into", dest="output", type=Path, default=Path(folder), help=words)
    parser.add_argument("--json", action="store_true", help="print the summary as JSON instead of lines")


def add_reading_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what states how logger files are read, and whose they are."""
    words = f"its YAML file with the same keys, or {EXAMPLE_CYLINDER}; default: params.yaml of a project"
    parser.add_argument("--cylinder", help=words)
    parser.add_argument("--channels", type=Path, help="mapping, as `ingest init` writes it; default: guessed")
    words = (
        "unit that the files do not state: pressure=bar, length=mm, time=ms, ..., or the rate of the rows: time=200Hz; "
        "may be repeated"
    )
    parser.add_argument("--unit", action="append", default=[], metavar="QUANTITY=UNIT", help=words)
    words = "accuracy of pressure sensors that state none, ± %% of full scale; 0.5 is typical; default: unknown"
    parser.add_argument("--sensor-class", type=float, metavar="PERCENT", help=words)
    parser.add_argument(
        "--load",
        metavar="none|measured|position|NEWTONS",
        type=load_of,
        help="what the cylinder carries, a weighed load as 4218 or 4218+-40; default: as mapped",
    )
    parser.add_argument("--dbc", type=Path, help="DBC file of the bus, for MDF files of CAN frames")
    parser.add_argument("--names", help="regular expression on a file's path, with the groups condition and session")


def load_of(given: str) -> LoadMode | StatedLoad:
    """Return how the load is known, or the constant load itself, from what ``--load`` states."""
    from cylinder_friction.recordings.checks.limits import LoadMode
    from cylinder_friction.recordings.recording import RecordingError
    from cylinder_friction.recordings.stated_load import StatedLoad

    modes: tuple[LoadMode, ...] = get_args(LoadMode)
    if given in modes:
        return modes[modes.index(given)]
    try:
        return StatedLoad.parsed(given)
    except RecordingError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def units_of(given: Sequence[str]) -> dict[str, str]:
    """Return the units by quantity that ``--unit`` states.

    Raises:
        ParamsError: An entry is no ``QUANTITY=UNIT``, or a quantity has two.
    """
    from cylinder_friction.params.file import ParamsError

    units: dict[str, str] = {}
    for entry in given:
        quantity, equals, unit = (part.strip() for part in entry.partition("="))
        if not (quantity and equals and unit) or units.setdefault(quantity, unit) != unit:
            raise ParamsError(f"--unit {entry}: expected QUANTITY=UNIT such as pressure=bar, once per quantity")
    return units


def run(options: argparse.Namespace) -> int:
    from cylinder_friction.estimation.from_logs import PAGE_FILE, estimate_logs
    from cylinder_friction.evaluation.friction_levels import in_words
    from cylinder_friction.execution.selection import workers_from_environment

    with ExitStack() as stack:
        if model := options.model:
            model, _ = model_folder(model, Path(stack.enter_context(tempfile.TemporaryDirectory())))
        if options.workers is not None and options.workers < 1:
            raise ValueError(f"--workers: got {options.workers}, expected at least 1")
        workers = stack.enter_context(workers_from_environment(options.workers or cores(), FEW_FILES))
        settings = {"model": model, "other_cylinder": options.other_cylinder, "file_format": options.format}
        function = partial(estimate_logs, **settings, workers=workers)
        result, notes = run_on_logs(function, options)
    differ = in_words(result.differences)
    beside = [f"bounds   {result.bounds}", *([f"loss     {result.loss}"] if result.loss else [])]
    beside += [f"differ   {differ}"] if differ else []
    print_result(result, notes, options.json, _lines(result), PAGE_FILE, beside)
    unusable = any(each.not_known for each in result.recordings if each.name in result.new)
    return 1 if result.refused or not result.recordings or unusable else 0


def cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def run_on_logs(function: Callable[..., Result], options: argparse.Namespace) -> tuple[Result, list[str]]:
    """Return what a function makes of the logs that ``add_log_arguments`` names, and the warnings it gave."""
    cylinder = cylinder_of(options.cylinder)
    result, notes = reported(
        lambda: function(
            options.logs,
            cylinder,
            options.output,
            channels=options.channels,
            load=options.load,
            names=options.names,
            units=units_of(options.unit),
            sensor_class=options.sensor_class,
            database=options.dbc,
        )
    )
    if options.cylinder is None:
        sizes = f"{1e3 * cylinder.bore_diameter_m:g} mm bore, {1e3 * cylinder.rod_diameter_m:g} mm rod"
        notes.insert(0, f"the cylinder is that of params.yaml, {cylinder.name} ({sizes}); state yours by --cylinder")
    return result, notes


def reported(function: Callable[[], Result]) -> tuple[Result, list[str]]:
    """Return what a function returns, and the warnings it gave."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        result = function()
    return result, [str(each.message) for each in caught]


def print_result(
    result: FrictionOfLogs | FrictionModels,
    notes: Sequence[str],
    as_json: bool,
    lines: Sequence[str],
    page: str,
    beside: Sequence[str] = (),
) -> None:
    """Print a result as JSON, or its notes, ``lines``, refused files and, with ``beside``, where everything lies."""
    if as_json:
        print(json.dumps({**result.to_dict(), "notes": notes}, indent=2))
        return
    refused = [f"{each.file}: refused: {each.reason}" for each in result.refused]
    where = [f"files    {result.folder}", f"page     {result.folder / page}"]
    print("\n".join([*(f"note     {note}" for note in notes), *lines, *refused, "", *beside, *where]))


def cylinder_of(given: str | None) -> Cylinder:
    """Return the cylinder of a YAML file, of ``name=value`` pairs, or of ``params.yaml`` here.

    Raises:
        ParamsError: A key is missing or unknown, or there is no ``params.yaml``.
    """
    import yaml

    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.files.whole_files import read_yaml
    from cylinder_friction.params.file import PARAMS_FILE, ParamsError

    if given is None and not PARAMS_FILE.is_file():
        raise ParamsError(
            f"which cylinder? Give its dimensions, for example --cylinder {EXAMPLE_CYLINDER}, or a YAML file with "
            f"these keys; there is no {PARAMS_FILE} in {Path.cwd()} to take them from"
        )
    if given is None:
        params = read_yaml(PARAMS_FILE)
        where, content = f"{PARAMS_FILE}, cylinder", params.get("cylinder", {}) if isinstance(params, dict) else {}
    else:
        where = f"--cylinder {given}"
        content = yaml.safe_load("{" + given.replace("=", ": ") + "}") if "=" in given else read_yaml(Path(given))
    needed = [each.name for each in fields(Cylinder) if each.default is MISSING]
    optional = [each.name for each in fields(Cylinder) if each.default is not MISSING]
    wrong = sorted(set(content if isinstance(content, dict) else {str(given): None}) - {*needed, *optional})
    missing = sorted(set(needed) - set(content)) if not wrong else []
    if wrong or missing:
        raise ParamsError(
            f"{where}: {'unknown' if wrong else 'missing'} {', '.join(wrong or missing)}; expected "
            f"{', '.join(needed)}, and if you like {', '.join(optional)}"
        )
    numbers: dict[str, Any] = {name: float(each) if type(each) is int else each for name, each in content.items()}
    return Cylinder(**numbers)


def _lines(result: FrictionOfLogs) -> list[str]:
    from cylinder_friction.estimation.results import remarks

    lines = []
    for each in result.recordings:
        if each.name not in result.new:
            continue
        friction = "friction unknown" if each.friction_n is None else f"friction {each.friction_n:.0f} N"
        beside = "".join(f"; {words}" for words in remarks(each))
        lines.append(f"{each.name}: {friction}, {each.duration_s:.0f} s, {each.usable_percent:.0f} % usable{beside}")
    return [*lines, *([""] if lines and result.news else []), *result.news]
