"""Time and memory of importing the package, of loading a saved model and of its first estimate, each in a new process.

``python performance/footprint.py [--model models/hybrid]`` prints a table; beside each figure stands that of a Python
process that only imports NumPy, the least that any estimate here can need.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path

MEASURE = """
import json, resource, sys, time
start = time.perf_counter()
{code}
print(json.dumps([time.perf_counter() - start, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024]))
"""
HEAVY = ("torch", "sklearn", "mlflow", "scipy.optimize", "scipy.special", "scipy.ndimage")
IMPORT = "import cylinder_friction"
LOAD = "import cylinder_friction as cf\nestimator = cf.load({model!r})"
ESTIMATE = LOAD + "\nstream = estimator.stream()\nstream.step(*([1e6, 1e6, 0.1] + [20.0] * 9)[:len(estimator.inputs)])"
REPEATS = 3


def measured(code: str) -> tuple[float, float]:
    """Return the smallest time [s] and peak memory [MB] of the code over three new processes."""
    runs = [
        json.loads(
            subprocess.run(
                [sys.executable, "-c", MEASURE.format(code=code)], capture_output=True, text=True, check=True
            ).stdout.splitlines()[-1]
        )
        for _ in range(REPEATS)
    ]
    return min(seconds for seconds, _ in runs), min(megabytes for _, megabytes in runs)


def main() -> None:
    """Print one line per step."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--model", type=Path, default=Path("models/hybrid"), help="folder of a saved estimator")
    model = str(parser.parse_args().model)
    steps = {
        "import numpy": "import numpy",
        "import cylinder_friction": IMPORT,
        "... and load a model": LOAD.format(model=model),
        "... and its first estimate": ESTIMATE.format(model=model),
    }
    print(f"{'step':<28}{'time [s]':>10}{'peak memory [MB]':>18}")
    for name, code in steps.items():
        seconds, megabytes = measured(code)
        print(f"{name:<28}{seconds:>10.3f}{megabytes:>18.0f}")
    found = subprocess.run(
        [
            sys.executable,
            "-c",
            f"{ESTIMATE.format(model=model)}\nimport sys; print(*(m for m in {HEAVY} if m in sys.modules))",
        ],
        capture_output=True,
        text=True,
        check=True,
    ).stdout.strip()
    print(f"training libraries imported: {found or 'none'}")


if __name__ == "__main__":
    main()
