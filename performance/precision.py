"""How far the C of `float` samples is from that of `double` samples.

    python performance/precision.py [MODEL] [--recordings FOLDER] [--position-step MM]

Steps both exports of a model through stored recordings, whose positions are first rounded to a sensor's step if that is
given. ``same samples``: both get the samples rounded to ``float``. ``own samples``: the C of ``double`` gets them as
they are. Prints the rows in which friction or a bound differs by more than 0.1 N, the largest differences of friction
and of the bounds, and the rows in which flags differ.
"""

import argparse
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.deployment.c_export.compiled import CompiledEstimator
from cylinder_friction.deployment.c_export.export import export_c
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.recordings.columns import POSITION
from cylinder_friction.recordings.storage import read_stored

DIFFERS_N = 0.1


def differences(double: CompiledEstimator, single: CompiledEstimator, samples: Array, fed: Array) -> Array:
    """Return rows that differ, largest differences of friction and bounds [N], rows of other flags; ``(4,)``.

    ``fed`` are the samples of the C of ``double``.
    """
    newtons, flags = double.stream().run(fed)
    rounded, rounded_flags = single.stream().run(samples)
    apart_n = np.abs(rounded - newtons)
    rows = np.count_nonzero((apart_n > DIFFERS_N).any(axis=1))
    return np.array([rows, apart_n[:, 0].max(), apart_n[:, 1:].max(), np.count_nonzero(flags != rounded_flags)])


def main() -> None:
    """Print one line per recording and kind of samples."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", type=Path, nargs="?", default=Path("models/hybrid"), help="folder of the estimator")
    parser.add_argument("--recordings", type=Path, default=Path("data/processed/test"), help="stored recordings")
    parser.add_argument("--position-step", type=float, metavar="MM", help="step of the position sensor")
    arguments = parser.parse_args()
    estimator = load_estimator(arguments.model)
    print(f"{'rows':>8}{'differ':>8}{'friction N':>12}{'bounds N':>12}{'flags':>8}")
    with TemporaryDirectory() as folder:
        double = CompiledEstimator(export_c(estimator, Path(folder) / "double"))
        single = CompiledEstimator(export_c(estimator, Path(folder) / "float", precision="float"))
        for recording in read_stored(arguments.recordings):
            samples = recording.samples(estimator.inputs).copy()
            if arguments.position_step:
                place, step_m = estimator.inputs.index(POSITION), 1e-3 * arguments.position_step
                samples[:, place] = step_m * np.round(samples[:, place] / step_m)
            rounded = samples.astype(np.float32).astype(np.float64)
            for title, fed in (("same samples", rounded), ("own samples", samples)):
                rows, friction_n, bounds_n, flags = differences(double, single, rounded, fed)
                figures = f"{len(samples):8d}{rows:8.0f}{friction_n:12.2g}{bounds_n:12.2g}{flags:8.0f}"
                print(f"{figures}  {recording.name}, {title}", flush=True)


if __name__ == "__main__":
    main()
