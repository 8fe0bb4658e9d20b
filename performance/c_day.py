"""A day at 200 Hz through the exported C: drift against a fresh start, holds beside motion, first hour beside last.

Usage: python performance/c_day.py [model folder] [steps] [without-offset]

``without-offset`` leaves out what a step spends on learning the offset of the sensors' zeros: the two times beside each
other are its price.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from cylinder_friction.deployment.c_export.compiled import OPTIMISED, find_compiler
from cylinder_friction.deployment.c_export.export import export_c
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.recordings.storage import read_recordings

DAY = 17_280_000
PROGRAM = Path(__file__).with_suffix(".c")


def main() -> None:
    """Export, compiles and runs ``c_day.c`` on the test recordings."""
    model = Path(sys.argv[1]) if len(sys.argv) > 1 else Path("models/hybrid")
    steps = sys.argv[2] if len(sys.argv) > 2 else str(DAY)
    samples = np.concatenate([recording.samples() for recording in read_recordings(Path("data/processed/test"))])
    with tempfile.TemporaryDirectory() as folder:
        estimator = load_estimator(model)
        if "without-offset" in sys.argv[3:]:
            estimator.offset = None
        exported = export_c(estimator, Path(folder))
        program, rows = Path(folder) / "c_day", Path(folder) / "samples"
        samples.astype(np.float64).tofile(rows)
        sources = [str(PROGRAM), str(exported.source), f"-I{folder}"]
        subprocess.run([find_compiler(), "-std=c99", *OPTIMISED, *sources, "-o", str(program), "-lm"], check=True)
        subprocess.run([str(program), str(rows), steps], check=True)


if __name__ == "__main__":
    main()
