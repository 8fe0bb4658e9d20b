"""Not a stage, but beside ``ingest``: the same files by the same rules, looked at instead of written."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from cylinder_friction.commands.params import CONF, composed
from cylinder_friction.evaluation.inspection.files import inspect_files
from cylinder_friction.labelling.known_offset import known_offsets
from cylinder_friction.labelling.sliding_blocks import LOADED
from cylinder_friction.params.checking import Params, ParamsError, check_params, load_params
from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.reporting.inspection.page import write_page
from cylinder_friction.reporting.inspection.recording_pane import Panes
from cylinder_friction.reporting.inspection.text import text_report
from cylinder_friction.signals.methods import filters_by_method
from cylinder_friction.stages.ingest import recipe_from
from cylinder_friction.stages.label import labeller_from
from cylinder_friction.stages.offset import plan_from


def inspect_path(path: Path, params: Params, page: Path) -> tuple[str, bool]:
    """Write the page of a file, or of the files of a folder; returns the report and whether anything was refused.

    Files of a folder are those that ``ingest.pattern`` matches. Memory holds the signals of one file at a time.

    Raises:
        RecordingError: The folder holds no such file.
        FileNotFoundError: There is neither file nor folder.
    """
    recipe = recipe_from(params, Path(params.ingest.source))
    files = _files(path, params, recipe.names.table)
    labeller, plan = labeller_from(params, params.ingest.load), plan_from(params.offset)
    filters = filters_by_method(labeller.cylinder, **params.filter.model_dump(exclude={"method"}))
    making = Panes(labeller, filters, params.filter.method, len(files), plan, LOADED.get(params.ingest.load, ""))
    panes = [making.pane(number, each) for number, each in enumerate(inspect_files(files, recipe), start=1)]
    evidence = [pane.offset for pane in panes if pane.offset is not None]
    offsets = known_offsets(evidence, labeller.cylinder, plan)
    write_page(page, panes, making, offsets)
    subjects = [pane.subject for pane in panes]
    return text_report(subjects, offsets).rstrip("\n"), any(each.outcome == "refused" for each in subjects)


def _files(path: Path, params: Params, names_table: Path | None) -> dict[str, Path]:
    if path.is_file():
        return {_shown(path, Path(params.ingest.source)): path}
    if not path.is_dir():
        raise FileNotFoundError(f"{path}: neither a file nor a folder")
    found = (entry for entry in path.glob(params.ingest.pattern) if entry.is_file())
    files = sorted(entry for entry in found if names_table is None or entry.absolute() != names_table.absolute())
    if not files:
        raise RecordingError(
            f"{path}: no file matches {params.ingest.pattern!r}; name another folder or ingest.pattern"
        )
    return {_shown(entry, Path(params.ingest.source), path): entry for entry in files}


def _shown(path: Path, *folders: Path) -> str:
    """Return a file's path below the first of the folders that it lies in, its name where it lies in none."""
    for folder in folders:
        if path.resolve().is_relative_to(folder.resolve()):
            return path.resolve().relative_to(folder.resolve()).as_posix()
    return path.name


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("path", type=Path, help="a logger's file, or a folder of them")
    parser.add_argument("overrides", nargs="*", help="for example ingest=own cylinder=press; without: params.yaml")
    parser.add_argument("--output", type=Path, default=Path("reports/inspection.html"))


def run(options: argparse.Namespace) -> int:
    report, refused = inspect_path(options.path, _params(options.path, options.overrides), options.output)
    print(f"{report}\n\npage     {options.output}")
    return 1 if refused else 0


def _params(path: Path, overrides: Sequence[str]) -> Params:
    if not overrides:
        return load_params()
    for entry in overrides:
        if "=" not in entry and not entry.startswith("~"):
            raise ParamsError(
                f"expected one path and then overrides such as ingest=own, but got {entry!r} after {str(path)!r}; "
                "to inspect several files, name the folder that holds them"
            )
    return check_params(composed(CONF, overrides), f"{CONF} with {list(overrides)}")
