"""The served model as MLflow runs it: rows of a data frame in and out; ``scoring.py`` beside it does the rest.

Both files go into the logged model with the estimator's graph, and run with MLflow, NumPy, pandas and ONNX Runtime
alone: nothing else of this project is needed where it is served. Nothing is pickled.
"""

from pathlib import Path
from types import ModuleType
from typing import Any

import mlflow
import numpy as np
import pandas as pd
from mlflow.exceptions import MlflowException
from mlflow.protos.databricks_pb2 import INVALID_PARAMETER_VALUE
from mlflow.pyfunc.model import PythonModel


class FrictionScoringModel(PythonModel):
    """Friction from rows of raw samples; see ``score_columns``."""

    def load_context(self, context: Any) -> None:
        """Run the model's own ``scoring`` code, whatever else is installed, and open its ``graph``."""
        source = Path(context.artifacts["scoring"])
        self._scoring: Any = ModuleType("friction_scoring")
        # its source itself: bytecode beside it may be of something else
        exec(compile(source.read_bytes(), str(source), "exec"), vars(self._scoring))  # noqa: S102
        self._graph = self._scoring.ServedGraph(Path(context.artifacts["graph"]))

    def predict(self, context: Any, model_input: pd.DataFrame, params: Any = None) -> pd.DataFrame:  # noqa: ARG002
        """Return what ``score_columns`` does, one row for each row given; rows that cannot be scored give 400.

        ``model_input`` is a data frame, or a dictionary of columns, as MLflow's server makes it of ``inputs`` and
        ``instances``.
        """
        try:
            scored = self._scoring.score_columns(self._graph, self._columns(model_input))
            index = getattr(model_input, "index", pd.RangeIndex(len(scored["flags"])))
            texts = pd.Series(scored["flag_names"], index, dtype=object)  # not copied into Arrow's text, and back
            return pd.DataFrame({**scored, "flag_names": texts}, index, copy=False)
        except self._scoring.ScoringError as error:
            raise MlflowException(str(error), error_code=INVALID_PARAMETER_VALUE) from error

    def _columns(self, rows: Any) -> dict[str, Any]:
        """Return the columns of rows whose index, if they have one, only counts them."""
        refused = self._scoring.ScoringError
        if isinstance(rows, dict) and all(np.ndim(values) == 1 for values in rows.values()):
            return rows
        if not isinstance(rows, pd.DataFrame):
            raise refused("got no rows with named columns; expected a list of values for each column")
        if not rows.columns.is_unique:
            twice = sorted({str(name) for name in rows.columns[rows.columns.duplicated()]})
            raise refused(f"columns {twice} are there more than once; expected each once")
        index = rows.index
        if not (index.step == 1 if isinstance(index, pd.RangeIndex) else list(index) == list(range(len(index)))):
            raise refused(
                f"the index, {index.name or 'without a name'}, begins with {index[:2].tolist()!r:.80}; expected row "
                "numbers from 0 without gaps: a CSV has more values than its header, recordings were put together, or "
                "rows were left out; send what it holds as a column, or leave it out where rows are whole recordings"
            )
        return {str(name): values.to_numpy() for name, values in rows.items()}


mlflow.models.set_model(FrictionScoringModel())
