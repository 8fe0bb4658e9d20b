"""The command ``latency``: measure the cost of one estimate in every runtime on this machine."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.deployment.c_export.compiled import NoCompilerError
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.recordings.files import write_json
from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.recordings.storage import read_stored
from cylinder_friction.run_record import RUNS_FOLDER, RunRecord
from cylinder_friction.stages._stage import (
    HYBRID_FOLDER,
    LUGRE_FOLDER,
    PAPER_HYBRID_FOLDER,
    PROCESSED_FOLDERS,
    REPORTS_FOLDER,
    artifacts,
    datasets,
)

if TYPE_CHECKING:
    from cylinder_friction.deployment.latency.measuring import Effort, Measured

EXPECTED = (NoCompilerError, ValueError)
LATENCY_FILE = REPORTS_FOLDER / "latency.json"
RUN_FILE = RUNS_FOLDER / "latency.json"
FOLDERS = (HYBRID_FOLDER, PAPER_HYBRID_FOLDER, LUGRE_FOLDER / "lugre")
RECORDINGS = 4  # Number of test recordings whose samples are taken


def measure_latency(folders: Sequence[Path], effort: Effort) -> str:
    """Measure models, write ``reports/latency.json``, log the run to MLflow, and return the tables.

    Raises:
        FileNotFoundError: A model or the test recordings are not there.
        NoCompilerError: There is no C compiler.
        ValueError: A model cannot be exported.
    """
    from cylinder_friction.deployment.latency.measuring import measure
    from cylinder_friction.deployment.latency.report import as_dict, table
    from cylinder_friction.tracking.log_run import track_or_warn

    chosen = list(folders) or list(FOLDERS)
    recordings = read_stored(PROCESSED_FOLDERS["test"])[:RECORDINGS]
    if not recordings:
        raise RecordingError(f"{PROCESSED_FOLDERS['test']}: holds no recording to step through; run `dvc repro split`")
    estimators = {name: load_estimator(path) for name, path in _named(chosen).items()}
    samples = {
        name: np.concatenate([recording.samples(estimator.inputs) for recording in recordings])
        for name, estimator in estimators.items()
    }
    measured = measure(estimators, samples, effort)
    write_json(LATENCY_FILE, as_dict(measured))
    record = run_record(measured)
    write_json(RUN_FILE, record.to_dict())
    track_or_warn(record, Path.cwd())
    return f"{table(measured)}\n\nfigures  {LATENCY_FILE}"


def run_record(measured: Measured) -> RunRecord:
    """Return the run that is logged to MLflow; ``reports/latency.json`` and the test recordings must be there."""
    from cylinder_friction.deployment.latency.report import metrics_of

    effort, quiet = measured.effort, measured.quiet
    return RunRecord(
        name="latency",
        params={
            "steps": effort.steps,
            "rounds": effort.rounds,
            "seconds": effort.seconds,
            "processor": str(measured.machine["processor"]),
            "compiler": str(measured.machine["compiler"]),
            "scheduling": str(measured.machine["scheduling"]),
            **{f"{name}.size": model.size for name, model in measured.models.items()},
        },
        metrics=metrics_of(measured),
        tags={"quiet": "unknown" if quiet.is_quiet is None else str(quiet.is_quiet).lower()},
        artifacts=artifacts(LATENCY_FILE),
        datasets=datasets({"test": PROCESSED_FOLDERS["test"]}),
    )


def _named(folders: Sequence[Path]) -> dict[str, Path]:
    """Return each folder by its name; by its whole path where two have one name."""
    names = [folder.name for folder in folders]
    return {folder.name if names.count(folder.name) == 1 else folder.as_posix(): folder for folder in folders}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("models", nargs="*", type=Path, help="folders of estimators; default: the pipeline's")
    parser.add_argument("--steps", type=int, default=100_000, help="timed steps per runtime, as far as time allows")


def run(options: argparse.Namespace) -> None:
    from cylinder_friction.deployment.latency.measuring import Effort

    print(measure_latency(options.models, Effort(options.steps)))
