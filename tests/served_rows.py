"""The served model's core on data frames, for tests that have their samples in one."""

import pandas as pd

from cylinder_friction.deployment.onnx_graphs.sequence import sequence_graph
from cylinder_friction.deployment.scoring import ServedGraph, score_columns
from cylinder_friction.realtime.model import StepModel


def served(model: StepModel) -> ServedGraph:
    return ServedGraph(sequence_graph(model).SerializeToString())


def score(graph: ServedGraph, rows: pd.DataFrame) -> pd.DataFrame:
    columns = {str(name): values.to_numpy() for name, values in rows.items()}
    return pd.DataFrame(score_columns(graph, columns), rows.index)
