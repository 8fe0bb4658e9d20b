"""The served model's core on data frames, for tests that have their samples in one."""

import pandas as pd

from cylinder_friction.deployment.scoring import ServedModel, score_columns


def score(served: ServedModel, rows: pd.DataFrame) -> pd.DataFrame:
    columns = {str(name): values.to_numpy() for name, values in rows.items()}
    return pd.DataFrame(score_columns(served, columns), rows.index)
