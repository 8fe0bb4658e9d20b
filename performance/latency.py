"""The cost of one step on one core, in every runtime and beside peers.

Usage: python performance/latency.py [model folder ...]

It only prints; `cylinder-friction latency` measures the runtimes alone and keeps the figures.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")

import numpy as np
import torch
from latency_peers import peers_of

from cylinder_friction.deployment.latency.measuring import Effort, measure
from cylinder_friction.deployment.latency.report import circumstances, model_table
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.recordings.storage import read_stored

FOLDERS = ("models/hybrid", "models/paper_hybrid", "models/lugre/lugre")


def main() -> None:
    """Print one table per model, then the circumstances of the run."""
    torch.set_num_threads(1)
    estimators = {folder: load_estimator(Path(folder)) for folder in sys.argv[1:] or FOLDERS}
    recordings = read_stored(Path("data/processed/test"))[:4]
    samples = {
        folder: np.concatenate([recording.samples(estimator.inputs) for recording in recordings])
        for folder, estimator in estimators.items()
    }
    measured = measure(estimators, samples, Effort(), peers_of)
    for name, model in measured.models.items():
        print(f"{model_table(name, model)}\n")
    print(circumstances(measured))


if __name__ == "__main__":
    main()
