"""Options on logger files (cylinder, load, units), and the printed result of a command on logger files."""

from __future__ import annotations

import argparse
import json
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import yaml

from cylinder_friction.commands.arguments import EXAMPLE_CYLINDER
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.files.whole_files import read_yaml
from cylinder_friction.params.file import PARAMS_FILE, ParamsError

if TYPE_CHECKING:
    from cylinder_friction.estimation.identified_model import FrictionModels
    from cylinder_friction.estimation.results import FrictionOfLogs

Result = TypeVar("Result")


def units_of(given: Sequence[str]) -> dict[str, str]:
    """Read the units by quantity from ``--unit``; ``ParamsError`` if one is no ``QUANTITY=UNIT`` or given twice."""
    units: dict[str, str] = {}
    for entry in given:
        quantity, equals, unit = (part.strip() for part in entry.partition("="))
        if not (quantity and equals and unit) or units.setdefault(quantity, unit) != unit:
            raise ParamsError(f"--unit {entry}: expected QUANTITY=UNIT such as pressure=bar, once per quantity")
    return units


def cylinder_of(given: str | None) -> Cylinder:
    """Read the cylinder from a YAML file, ``name=value`` pairs or ``params.yaml`` here; else ``ParamsError``."""
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


def run_on_logs(function: Callable[..., Result], options: argparse.Namespace) -> tuple[Result, list[str]]:
    """Call a function on the logs of ``add_log_arguments``; return its result and the warnings it gave."""
    cylinder = cylinder_of(options.cylinder)
    given: dict[str, Any] = {"load": options.load, "units": units_of(options.unit), "database": options.dbc}
    given |= {name: getattr(options, name) for name in ("channels", "names", "sensor_class")}
    result, notes = collect_notes(lambda: function(options.logs, cylinder, options.output, **given))
    if options.cylinder is None:
        sizes = f"{1e3 * cylinder.bore_diameter_m:g} mm bore, {1e3 * cylinder.rod_diameter_m:g} mm rod"
        notes.insert(0, f"the cylinder is that of params.yaml, {cylinder.name} ({sizes}); state yours by --cylinder")
    return result, notes


def collect_notes(function: Callable[[], Result]) -> tuple[Result, list[str]]:
    """Call a function; return its result and the warnings it gave."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        result = function()
    return result, [str(each.message) for each in caught]


def advice(guessed: Mapping[str, Any] | None, reasons: Iterable[str]) -> list[str]:
    """Say how a mapping is given if a reason for a refusal names the mapping, but this one was guessed."""
    if guessed is None or not any("mapping" in each or "channels." in each for each in reasons):
        return []
    words = f"the mapping named above was guessed from {guessed['from']}, as no mapping was given"
    return [f"note     {words}: `cylinder-friction ingest init` writes one, to be given by --channels"]


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
    refused = [f"{each.where}: refused: {each.reason}" for each in result.refused]
    refused += advice(result.guessed, refused)
    where = [f"files    {result.folder}", f"page     {result.folder / page}"]
    print("\n".join([*(f"note     {note}" for note in notes), *lines, *refused, "", *beside, *where]))
