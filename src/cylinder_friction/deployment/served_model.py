"""The served model as an MLflow folder: code, ONNX and JSON, signature, example and origin."""

import shutil
import warnings
from importlib import import_module
from pathlib import Path
from typing import Any

import pandas as pd
from mlflow.models import Model, ModelSignature
from mlflow.types import ColSpec, DataType, Schema

from cylinder_friction.deployment.brought_code import MODEL_CODE, copy_code, model_metadata, requirements_of
from cylinder_friction.deployment.golden_recording import golden_content
from cylinder_friction.deployment.golden_trajectory import GOLDEN_FILE
from cylinder_friction.deployment.scoring import RECORDING_COLUMN, TIME_COLUMN
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.files.whole_files import write_json
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.recordings.columns import LOAD_FORCE

OUTPUTS = Schema(
    [
        *(ColSpec(DataType.double, name) for name in ("friction_n", "lower_n", "upper_n")),
        ColSpec(DataType.long, "flags"),
        ColSpec(DataType.string, "flag_names"),
        ColSpec(DataType.boolean, "in_training_range"),
        *(ColSpec(DataType.double, name, required=False) for name in ("offset_n", "offset_uncertainty_n")),
    ]
)


def input_schema(model: StepModel) -> Schema:
    """List the columns that the served model takes. MLflow refuses a table without the required ones.

    The load is optional in every model: MLflow drops columns that a signature does not name, and a model that knows no
    load must see one to refuse it.
    """
    optional = [ColSpec(DataType.string, RECORDING_COLUMN, required=False)]
    optional += [ColSpec(DataType.double, name, required=False) for name in (TIME_COLUMN, LOAD_FORCE)]
    required = [ColSpec(DataType.double, name) for name in model.inputs]
    return Schema([*required, *(each for each in optional if each.name not in model.inputs)])


def save_model_folder(
    path: Path, estimator: Path, lineage: dict[str, Any], example: pd.DataFrame, mlflow_model: Model
) -> None:
    """Write an MLflow model folder that holds everything the served model needs.

    The files of ``estimator``, a folder, go in as they are, ``lineage`` as ``lineage.json``. ``mlflow_model`` carries
    the ids that MLflow gave the model.
    """
    lineage_path, golden = path.with_name("lineage.json"), path.with_name(GOLDEN_FILE)
    write_json(lineage_path, lineage)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # MLflow's pyfunc warns of its own type hints when imported
        pyfunc = import_module("mlflow.pyfunc")
    # MLflow refuses links, and files of the estimator may be links into DVC's cache
    files = shutil.copytree(estimator, path.with_name("estimator") / estimator.name)
    loaded = load_estimator(files)
    model = loaded.step_model()
    write_json(golden, golden_content(model))
    pyfunc.save_model(
        path=str(path),
        python_model=str(MODEL_CODE),
        code_paths=[str(each) for each in copy_code(path.with_name("code"), loaded.kind)],
        artifacts={"estimator": str(files), "golden": str(golden), "lineage": str(lineage_path)},
        signature=ModelSignature(input_schema(model), OUTPUTS),
        metadata=model_metadata(model),
        input_example=example,
        pip_requirements=requirements_of(loaded.kind),
        mlflow_model=mlflow_model,
    )
    for cache in path.rglob("__pycache__"):
        shutil.rmtree(cache)
