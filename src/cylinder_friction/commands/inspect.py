"""Not a stage, but beside ``ingest``: the same files by the same rules, looked at instead of written."""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from cylinder_friction.commands.params import CONF, composed
from cylinder_friction.labelling.label import Labeller
from cylinder_friction.params.checking import Params, ParamsError, check_params, load_params
from cylinder_friction.recordings.checks.finding import Finding
from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.reporting.inspection.choice import held
from cylinder_friction.reporting.inspection.files import inspect_files
from cylinder_friction.reporting.inspection.friction_view import with_friction
from cylinder_friction.reporting.inspection.page import write_page
from cylinder_friction.reporting.inspection.sensor_offsets import known_offsets
from cylinder_friction.reporting.inspection.subject import Inspected
from cylinder_friction.reporting.inspection.text import text_report
from cylinder_friction.signals.methods import filters_by_method, windows_at
from cylinder_friction.signals.smooth_signals import SignalFilter, filtered
from cylinder_friction.stages._stage import cylinder_from
from cylinder_friction.stages.ingest import recipe_from
from cylinder_friction.stages.label import labeller_from
from cylinder_friction.stages.offset import LOADED, plan_from


def inspect_path(path: Path, params: Params, page: Path) -> tuple[str, bool]:
    """Write the page of a file, or of the files of a folder; returns the report and whether anything was refused.

    Files of a folder are those that ``ingest.pattern`` matches. Memory holds the recordings that are drawn, no more.

    Raises:
        RecordingError: The folder holds no such file.
        FileNotFoundError: There is neither file nor folder.
    """
    recipe = recipe_from(params, Path(params.ingest.source))
    files = _files(path, params, recipe.names.table)
    cylinder, margin_m = cylinder_from(params.cylinder), params.label.end_stop_margin_m
    filters = filters_by_method(cylinder, **params.filter.model_dump(exclude={"method"}))
    labeller, chosen = labeller_from(params, params.ingest.load), filters[params.filter.method]
    loaded = (_with_load(_with_rate(subject, chosen), labeller, chosen) for subject in inspect_files(files, recipe))
    plan, no_offset = plan_from(params.offset), LOADED.get(params.ingest.load, "")
    subjects = held(with_friction(subject, cylinder, chosen, margin_m, plan, no_offset) for subject in loaded)
    evidence = [subject.offset for subject in subjects if subject.offset is not None]
    offsets = known_offsets(evidence, cylinder, plan)
    write_page(page, subjects, cylinder, filters, params.filter.method, margin_m, offsets=offsets)
    return text_report(subjects, offsets).rstrip("\n"), any(subject.outcome == "refused" for subject in subjects)


def _with_rate(subject: Inspected, used_filter: SignalFilter) -> Inspected:
    """Return a subject with a note where the filter's windows were not chosen for its recording's rate."""
    text = "" if subject.recording is None else windows_at(used_filter, subject.recording.sample_time_s)
    return replace(subject, findings=[*subject.findings, Finding("filter_windows", "noted", text)]) if text else subject


def _with_load(subject: Inspected, labeller: Labeller, used_filter: SignalFilter) -> Inspected:
    """Return a subject whose recording has the load identified from its own strokes, where position decides it.

    ``label`` asks whole sessions; here each recording speaks for itself. What is refused is not asked.
    """
    if subject.recording is None or subject.outcome == "refused" or labeller.load != "position":
        return subject
    recording = subject.recording
    try:
        load = labeller.identify([filtered(recording, used_filter)], used_filter).load
    except ValueError as error:  # shorter than the filter, or strokes that determine no load
        return replace(subject, findings=[*subject.findings, Finding("load", "noted", str(error))])
    assert load is not None
    with_load = recording.with_columns(load_force_n=load.load_n(recording.column("position_m")))
    return replace(subject, recording=with_load, findings=[*subject.findings, Finding("load", "ok", load.sentence())])


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
