"""The estimator as an MLflow model: a folder with code, ONNX and JSON, signature, example and origin."""

from __future__ import annotations

import json
import warnings
from importlib import import_module, metadata, util
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mlflow.models import Model, ModelSignature
from mlflow.types import ColSpec, DataType, Schema

if TYPE_CHECKING:
    import pandas as pd

SCORING_MODULE = "cylinder_friction.deployment.scoring_model"
ESTIMATOR_ARTIFACT = "estimator"
LINEAGE_ARTIFACT = "lineage"
LINEAGE_FILE = "lineage.json"
REQUIREMENTS = ("cylinder-friction", "mlflow", "numpy", "pandas", "numba", "onnx", "onnxruntime")

SIGNATURE = ModelSignature(
    inputs=Schema(
        [
            ColSpec(DataType.double, "pressure_1_pa"),
            ColSpec(DataType.double, "pressure_2_pa"),
            ColSpec(DataType.double, "position_m"),
            ColSpec(DataType.string, "recording", required=False),
        ]
    ),
    outputs=Schema([ColSpec(DataType.double, "friction_n"), ColSpec(DataType.boolean, "in_training_range")]),
)


def save_model_folder(
    path: Path, estimator: Path, lineage: dict[str, Any], example: pd.DataFrame, mlflow_model: Model
) -> None:
    """Writes an MLflow model folder that holds everything the served model needs.

    Args:
        path: Where; must not be there yet.
        estimator: Folder of a saved estimator; its files go in as they are.
        lineage: What the model came from; written as ``lineage.json`` inside it.
        example: A few rows that the model takes.
        mlflow_model: Carries the ids that MLflow gave the model.
    """
    lineage_path = path.with_name(LINEAGE_FILE)
    lineage_path.write_text(json.dumps(lineage, indent=2, sort_keys=True) + "\n", encoding="utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # MLflow's pyfunc warns of its own type hints when imported
        pyfunc = import_module("mlflow.pyfunc")
    pyfunc.save_model(
        path=str(path),
        python_model=str(_scoring_code()),
        artifacts={ESTIMATOR_ARTIFACT: str(estimator), LINEAGE_ARTIFACT: str(lineage_path)},
        signature=SIGNATURE,
        input_example=example,
        pip_requirements=[f"{name}=={metadata.version(name)}" for name in REQUIREMENTS],
        mlflow_model=mlflow_model,
    )


def artifact_path(model_folder: Path, artifact: str) -> Path:
    """Returns where an artifact lies in a model folder."""
    configured = Model.load(str(model_folder)).flavors["python_function"]["artifacts"][artifact]["path"]
    return model_folder / configured


def _scoring_code() -> Path:
    found = util.find_spec(SCORING_MODULE)
    assert found is not None
    assert found.origin is not None
    return Path(found.origin)
