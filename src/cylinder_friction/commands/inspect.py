"""The command ``inspect``: check the files that ``ingest`` would read, by the same rules, and draw a page.

In a project the rules come from ``params.yaml`` and overrides; with ``--cylinder`` or ``--channels``, and outside a
project, they are those of ``estimate``.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path

from cylinder_friction.commands.log_options import advice, collect_notes, cylinder_of, units_of
from cylinder_friction.evaluation.inspection.files import inspect_files
from cylinder_friction.labelling.apparent_loss import missing_loss, named_loss
from cylinder_friction.labelling.known_offset import known_offsets
from cylinder_friction.labelling.label import Labeller
from cylinder_friction.labelling.sliding_blocks import LOADED, OffsetPlan
from cylinder_friction.params.checking import Params, check_params, load_params
from cylinder_friction.params.file import PARAMS_FILE, ParamsError
from cylinder_friction.recordings.logs import Recipe, find_logs
from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.reporting.inspection.page import write_page
from cylinder_friction.reporting.inspection.recording_pane import Panes
from cylinder_friction.reporting.inspection.text import text_report
from cylinder_friction.signals.methods import filters_by_method
from cylinder_friction.signals.rts import RtsSmoother
from cylinder_friction.signals.smooth_signals import SignalFilter
from cylinder_friction.signals.zero_phase import SavitzkyGolay, default_filter
from cylinder_friction.stages.ingest import recipe_from
from cylinder_friction.stages.label import labeller_from
from cylinder_friction.stages.offset import plan_from


def inspect_path(path: Path, params: Params, page: Path) -> tuple[str, bool]:
    """Write the page of a file, or of the files of a folder, by the rules of a project.

    In a folder, ``ingest.pattern`` selects the files. The signals of only one file are in memory at a time.

    Returns:
        The report, and whether anything was refused.

    Raises:
        RecordingError: The folder holds no such file.
        FileNotFoundError: There is neither file nor folder.
    """
    recipe = recipe_from(params)
    files = _files(path, params)
    labeller, plan = labeller_from(params, params.ingest.load), plan_from(params.offset)
    filters = filters_by_method(labeller.cylinder, **params.filter.model_dump(exclude={"method"}))
    no_offset = LOADED.get(params.ingest.load, "")
    making = Panes(labeller, filters, params.filter.method, len(files), plan, no_offset, in_pipeline=True)
    return _inspect_files(files, recipe, making, page)


def _inspect_files(files: Mapping[str, Path], recipe: Recipe, making: Panes, page: Path) -> tuple[str, bool]:
    panes = [making.pane(number, each) for number, each in enumerate(inspect_files(files, recipe), start=1)]
    evidence = [pane.offset for pane in panes if pane.offset is not None]
    offsets = known_offsets(evidence, making.labeller.cylinder, making.plan)
    write_page(page, panes, making, offsets)
    subjects, loss = [pane.subject for pane in panes], named_loss(evidence)
    report = text_report(subjects, offsets).rstrip("\n")
    if loss is not None:
        report += f"\n\nloss     {loss.sentence(making.labeller.cylinder)}; the ± of means above does not include it"
    if missing := missing_loss(evidence):
        report += f"\n\nloss     {missing}"
    return report, any(each.outcome == "refused" for each in subjects)


def _without_project(options: argparse.Namespace) -> tuple[str, bool]:
    """Inspect logs as ``estimate`` reads them; warnings of a guessed mapping come before the report."""
    overrides = [each for each in options.overrides if "=" in each]
    if overrides:
        raise ParamsError(
            f"overrides such as {overrides[0]!r} are for a project; leave them out, or leave out "
            "--cylinder, --channels, --load, --unit, --names, --sensor-class and --dbc"
        )
    cylinder = cylinder_of(options.cylinder)
    given = {"load": options.load, "units": units_of(options.unit), "database": options.dbc}
    given["sensor_class"] = options.sensor_class
    paths, names = [options.path, *options.overrides], options.names
    logs, notes = collect_notes(lambda: find_logs(paths, options.channels, cylinder, names=names, **given))
    load = logs.recipe.limits.load
    filters: dict[str, SignalFilter] = {
        "adaptive": default_filter(cylinder),
        "savitzky_golay": SavitzkyGolay(),
        "rts": RtsSmoother(),
    }
    making = Panes(
        Labeller(cylinder, load=load), filters, "adaptive", len(logs.files), OffsetPlan(), LOADED.get(load, "")
    )
    report, refused = _inspect_files(logs.files, logs.recipe, making, options.output)
    return "\n".join(
        [*(f"note     {note}" for note in notes), report, *advice(logs.guessed, [report] * refused)]
    ), refused


def _files(path: Path, params: Params) -> dict[str, Path]:
    if path.is_file():
        return {_short_path(path, Path(params.ingest.source)): path}
    if not path.is_dir():
        raise FileNotFoundError(f"{path}: neither a file nor a folder")
    files = sorted(entry for entry in path.glob(params.ingest.pattern) if entry.is_file())
    if not files:
        raise RecordingError(
            f"{path}: no file matches {params.ingest.pattern!r}; name another folder or ingest.pattern"
        )
    return {_short_path(entry, Path(params.ingest.source), path): entry for entry in files}


def _short_path(path: Path, *folders: Path) -> str:
    """Shorten a file's path to its part below the first folder that holds it; its name if none does."""
    for folder in folders:
        if path.resolve().is_relative_to(folder.resolve()):
            return path.resolve().relative_to(folder.resolve()).as_posix()
    return path.name


def run(options: argparse.Namespace) -> int:
    if options.output.suffix.lower() not in (".html", ".htm"):
        raise ParamsError(f"--output: expected a file whose name ends in .html, but got {options.output.name!r}")
    stated = any(getattr(options, name) for name in ("cylinder", "channels", "load", "unit", "names", "dbc"))
    in_project = PARAMS_FILE.is_file() or any("=" in each or each.startswith("~") for each in options.overrides)
    if stated or options.sensor_class is not None or not in_project:
        report, refused = _without_project(options)
    else:
        report, refused = inspect_path(options.path, _params(options.path, options.overrides), options.output)
    print(f"{report}\n\npage     {options.output}")
    return 1 if refused else 0


def _params(path: Path, overrides: Sequence[str]) -> Params:
    if not overrides:
        return load_params()
    from cylinder_friction.params.composing import CONF, composed  # Hydra: an extra, only for overrides

    for entry in overrides:
        if "=" not in entry and not entry.startswith("~"):
            raise ParamsError(
                f"expected one path and then overrides such as ingest=own, but got {entry!r} after {str(path)!r}; "
                "to inspect several files, name the folder that holds them"
            )
    return check_params(composed(CONF, overrides), f"{CONF} with {list(overrides)}")
