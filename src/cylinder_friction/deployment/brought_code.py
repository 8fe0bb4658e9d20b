"""Contents of a served model: the package's code that it runs, its requirements and its metadata."""

import shutil
from importlib.metadata import version
from pathlib import Path
from typing import Any

from cylinder_friction.deployment.descriptions import described_inputs
from cylinder_friction.deployment.scoring import RECORDING_COLUMN, TIME_COLUMN
from cylinder_friction.estimators.entry_points import own_kinds
from cylinder_friction.import_graph import SOURCE, imported_modules, used_files
from cylinder_friction.realtime.model import StepModel

PACKAGE = SOURCE / "cylinder_friction"
MODEL_CODE = PACKAGE / "deployment/scoring_model.py"
SERVED_MODULES = (
    "cylinder_friction.deployment.golden_trajectory",
    "cylinder_friction.deployment.scoring",
    "cylinder_friction.estimators.loading",
)
"""Modules that the served model runs; the model contains them, and all modules that they import."""
REQUIREMENTS = ("mlflow", "numba", "numpy", "onnx", "pandas", "pyarrow", "pyyaml", "scipy", "tqdm")
"""Packages that the served model needs to load and to estimate; neither torch nor scikit-learn is among them."""


def copy_package(folder: Path) -> Path:
    """Copy the modules of the package that inference needs into a folder; return the package's folder there."""
    used = {*used_files(*SERVED_MODULES, *imported_modules(PACKAGE.name))}
    packages = {parent / "__init__.py" for path in used for parent in path.parents if parent.is_relative_to(PACKAGE)}
    for path in used | packages:
        target = folder / path.relative_to(SOURCE)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, target)
    return folder / PACKAGE.name


def requirements_of(kind: str) -> list[str]:
    """List the packages that a model needs; an estimator of another package needs that package too."""
    own = own_kinds()[kind].dist if kind in own_kinds() else None
    named = [f"{name}=={version(name)}" for name in REQUIREMENTS]
    return named if own is None else [*named, f"{own.name}=={own.version}"]


def model_metadata(model: StepModel) -> dict[str, Any]:
    """Collect the metadata of the logged model: its inputs, sample time and bounds."""
    optional = {
        RECORDING_COLUMN: "optional: the name of each row's recording, whose rows follow each other",
        TIME_COLUMN: "optional: each row's time, to be checked [s]",
    }
    return {
        "inputs": {each.column: each.meaning for each in described_inputs(model.inputs)} | optional,
        "sample_time_s": float(model.sample_time_s),
        "bounds": model.bounds.in_words(),
        **({"corrections": applied} if (applied := model.applied()) else {}),
        **({} if model.trained_for is None else {"trained_for": model.trained_for.in_words()}),
    }
