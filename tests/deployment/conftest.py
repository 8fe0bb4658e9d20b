"""A repository with a champion, and the golden model as it is logged."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from mlflow.models import Model

from champion_repository import champion_root
from cylinder_friction.deployment.served_model import save_model_folder
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from golden_fixtures import GOLDEN, samples

__all__ = ["champion_root", "samples"]


@pytest.fixture(scope="session")
def golden_folder(samples: np.ndarray, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The golden model as MLflow has it, with the golden samples as its example."""
    folder = tmp_path_factory.mktemp("logged") / "model"
    save_model_folder(folder, GOLDEN / "model", {}, pd.DataFrame(samples, columns=list(SAMPLE_COLUMNS)), Model())
    return folder
