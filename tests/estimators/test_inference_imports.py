"""Inference needs no training library: neither loading nor estimating imports one."""

import subprocess
import sys
from pathlib import Path

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.baselines import baselines
from cylinder_friction.estimators.forest import ForestPlan
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.lugre import LugreEstimator
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.recordings.storage import write_recording

SCRIPT = """
import sys
from pathlib import Path
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.recordings.storage import read_stored

(recording,) = read_stored(Path(sys.argv[1]) / "recordings")
for folder in sorted(Path(sys.argv[1]).glob("model_*")):
    estimator = load_estimator(folder)
    estimator.estimate(recording)
    estimator.stream().step(*recording.samples(estimator.inputs)[0])
    heavy = {"torch", "sklearn", "mlflow"}
    print(folder.name, *sorted(heavy & set(sys.modules)))
"""


def test_loading_and_estimating_import_no_training_library(
    cylinder: Cylinder, small_hybrid: HybridEstimator, labelled_recordings: list[Recording], tmp_path: Path
) -> None:
    made: dict[str, FrictionEstimator] = {"hybrid": small_hybrid, "lstm": small_hybrid.without_forest()}
    fresh = baselines(cylinder, forest_plan=ForestPlan(3, 3, 1000, 5)) | {
        "lugre": LugreEstimator(cylinder, population=3, generations=1, simulated_recordings=1)
    }
    made |= {name: estimator.fit(labelled_recordings) for name, estimator in fresh.items()}
    for name, estimator in made.items():
        estimator.save(tmp_path / f"model_{name}")
    write_recording(tmp_path / "recordings", labelled_recordings[0])
    run = subprocess.run([sys.executable, "-c", SCRIPT, str(tmp_path)], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    assert run.stdout.split() == sorted(f"model_{name}" for name in made)
