"""What one estimate costs at batch 1 on one core, in every runtime, beside the floor of the machine.

Usage: python performance/latency.py [model folder ...]

It prints, and leaves nothing behind; `cylinder-friction bench` writes reports/latency.json and tells MLflow.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")

import numpy as np

from cylinder_friction.deployment.latency.measuring import Effort, measure
from cylinder_friction.deployment.latency.report import table
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.recordings.storage import read_recordings

FOLDERS = ("models/hybrid", "models/paper_hybrid", "models/lugre/lugre")


def main() -> None:
    """Print a table a model, floors and verdicts."""
    estimators = {folder: load_estimator(Path(folder)) for folder in sys.argv[1:] or FOLDERS}
    recordings = read_recordings(Path("data/processed/test"))[:4]
    samples = np.concatenate([recording.samples() for recording in recordings])
    sys.stdout.write(table(measure(estimators, samples, Effort(instructions=True))) + "\n")


if __name__ == "__main__":
    main()
