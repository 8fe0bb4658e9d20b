"""The served model, logged as code: MLflow copies this file beside the estimator's folder and runs it, no pickle."""

from pathlib import Path
from typing import Any

import mlflow
import pandas as pd  # MLflow reads predict's type hints at run time
from mlflow.exceptions import MlflowException
from mlflow.protos.databricks_pb2 import INVALID_PARAMETER_VALUE
from mlflow.pyfunc.model import PythonModel

from cylinder_friction.deployment.scoring import ScoringError, score
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.realtime.stream import RealTimeStream


class FrictionScoringModel(PythonModel):
    """Friction from rows of raw samples; see ``cylinder_friction.deployment.scoring.score``."""

    def load_context(self, context: Any) -> None:
        """Load the estimator from the model's artifact ``estimator``, and compile its step before the first request."""
        self._model = load_estimator(Path(context.artifacts["estimator"])).step_model()
        RealTimeStream(self._model)

    def predict(self, context: Any, model_input: pd.DataFrame, params: Any = None) -> pd.DataFrame:  # noqa: ARG002
        """Return what ``score`` does, one row for each row given; rows that cannot be scored give 400."""
        try:
            return score(self._model, model_input)
        except ScoringError as error:
            raise MlflowException(str(error), error_code=INVALID_PARAMETER_VALUE) from error


mlflow.models.set_model(FrictionScoringModel())
