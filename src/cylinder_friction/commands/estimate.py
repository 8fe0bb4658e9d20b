"""The command ``estimate``: from logger files to files of friction and a page, with or without a trained model."""

from __future__ import annotations

import argparse
import os
import tempfile
from contextlib import ExitStack
from functools import partial
from pathlib import Path

from cylinder_friction.commands._model import model_folder
from cylinder_friction.commands.arguments import FEW_FILES
from cylinder_friction.commands.log_options import print_result, run_on_logs
from cylinder_friction.estimation.from_logs import estimate_logs
from cylinder_friction.estimation.results import PAGE_FILE, FrictionOfLogs, remarks
from cylinder_friction.evaluation.friction_levels import in_words
from cylinder_friction.execution.selection import workers_from_environment
from cylinder_friction.wording import counted

EXPECTED = (ValueError, OSError)


def run(options: argparse.Namespace) -> int:
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
    beside = ["friction half of extending less retracting at equal position"] if result.new else []
    beside += [f"bounds   {result.bounds}", *([f"loss     {result.loss}"] if result.loss else [])]
    beside += [f"differ   {differ}"] if differ else []
    print_result(result, notes, options.json, _lines(result), PAGE_FILE, beside)
    unusable = any(each.not_known for each in result.recordings if each.name in result.new)
    unknown = all(each.friction_n is None or each.load_left_n is not None for each in result.recordings)
    return 1 if result.refused or unusable or unknown else 0


def cores() -> int:
    """Count the cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _lines(result: FrictionOfLogs) -> list[str]:
    lines = []
    for each in result.recordings:
        if each.name not in result.new:
            continue
        friction = "friction unknown" if each.friction_n is None else f"friction {each.friction_n:z.0f} N"
        beside = "".join(f"; {words}" for words in remarks(each))
        lines.append(f"{each.name}: {friction}, {each.duration_s:.0f} s, {each.usable_percent:.0f} % usable{beside}")
    kept = len(result.recordings) - len(result.new)
    return [*lines, f"{counted(kept, 'result')} of earlier runs kept"] if kept else lines
