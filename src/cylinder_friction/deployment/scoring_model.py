"""The served model, logged as code: MLflow copies this file beside the estimator's folder and runs it, no pickle."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mlflow
from mlflow.exceptions import MlflowException
from mlflow.protos.databricks_pb2 import INVALID_PARAMETER_VALUE
from mlflow.pyfunc.model import PythonModel

from cylinder_friction.deployment.onnx_estimator import load_onnx
from cylinder_friction.deployment.scoring import ScoringError, score


class FrictionScoringModel(PythonModel):
    """Friction from rows of raw samples; see ``cylinder_friction.deployment.scoring.score``."""

    def load_context(self, context: Any) -> None:
        """Loads the estimator from the model's artifact ``estimator``."""
        self._estimator = load_onnx(Path(context.artifacts["estimator"]))

    # MLflow would take a type hint of ``model_input`` for the signature; the signature is given when it is logged.
    def predict(self, context, model_input, params=None):  # type: ignore[no-untyped-def]  # noqa: ARG002
        """Returns ``friction_n`` and ``in_training_range`` a row; what cannot be scored is answered with 400."""
        try:
            return score(self._estimator, model_input)
        except ScoringError as error:
            raise MlflowException(str(error), error_code=INVALID_PARAMETER_VALUE) from error


mlflow.models.set_model(FrictionScoringModel())
