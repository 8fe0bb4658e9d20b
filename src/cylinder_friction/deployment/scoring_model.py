"""The served model as MLflow runs it: rows of a data frame in and out; ``scoring.py`` beside it does the rest.

Both files go into the logged model with the estimator's graph, and run with MLflow, NumPy, pandas and ONNX Runtime
alone: nothing else of this project is needed where it is served. Nothing is pickled.
"""

import importlib.util
from pathlib import Path
from typing import Any

import mlflow
import pandas as pd  # MLflow reads predict's type hints at run time
from mlflow.exceptions import MlflowException
from mlflow.protos.databricks_pb2 import INVALID_PARAMETER_VALUE
from mlflow.pyfunc.model import PythonModel


class FrictionScoringModel(PythonModel):
    """Friction from rows of raw samples; see ``score_columns``."""

    def load_context(self, context: Any) -> None:
        """Run the model's own ``scoring`` code, whatever else is installed, and open its ``graph``."""
        spec = importlib.util.spec_from_file_location("friction_scoring", context.artifacts["scoring"])
        if spec is None or spec.loader is None:
            raise MlflowException(f"{context.artifacts['scoring']} cannot be run; expected the model's scoring.py")
        self._scoring: Any = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(self._scoring)
        self._graph = self._scoring.ServedGraph(Path(context.artifacts["graph"]))

    def predict(self, context: Any, model_input: pd.DataFrame, params: Any = None) -> pd.DataFrame:  # noqa: ARG002
        """Return what ``score_columns`` does, one row for each row given; rows that cannot be scored give 400."""
        try:
            if not model_input.columns.is_unique:
                twice = sorted({str(name) for name in model_input.columns[model_input.columns.duplicated()]})
                raise self._scoring.ScoringError(f"columns {twice} are there more than once; expected each once")
            columns = {str(name): values.to_numpy() for name, values in model_input.items()}
            return pd.DataFrame(self._scoring.score_columns(self._graph, columns), model_input.index)
        except self._scoring.ScoringError as error:
            raise MlflowException(str(error), error_code=INVALID_PARAMETER_VALUE) from error


mlflow.models.set_model(FrictionScoringModel())
