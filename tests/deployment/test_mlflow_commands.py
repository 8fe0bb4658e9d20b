"""MLflow's own commands and `load_model` take the logged model as any other."""

import json
import subprocess
import sys
from pathlib import Path

import mlflow
import numpy as np
import pandas as pd
import pytest
from mlflow.exceptions import MlflowException

from cylinder_friction.realtime.model import StepModel
from cylinder_friction.realtime.stream import RealTimeStream
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from golden_fixtures import golden_model

__all__ = ["golden_model"]


def mlflow_models(cwd: Path, *words: str) -> None:
    command = [sys.executable, "-m", "mlflow", "models", *words]
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.extended
def test_predict_gives_the_steps_digits(
    golden_folder: Path, golden_model: StepModel, samples: np.ndarray, tmp_path: Path
) -> None:
    body = ("-i", str(golden_folder / "serving_input_example.json"), "-o", str(tmp_path / "out.json"))
    mlflow_models(tmp_path, "predict", "-m", str(golden_folder), "--env-manager", "local", *body)
    rows = json.loads((tmp_path / "out.json").read_text())["predictions"]
    newtons, flags = RealTimeStream(golden_model).run(samples)
    np.testing.assert_array_equal([[row["friction_n"], row["lower_n"], row["upper_n"]] for row in rows], newtons)
    assert [row["flags"] for row in rows] == flags.tolist()


@pytest.mark.extended
def test_a_dockerfile_brings_the_model_with_its_code_and_requirements(golden_folder: Path, tmp_path: Path) -> None:
    mlflow_models(
        tmp_path, "generate-dockerfile", "-m", str(golden_folder), "-d", "image", "--env-manager", "virtualenv"
    )
    assert "COPY model_dir" in (tmp_path / "image/Dockerfile").read_text()
    brought = next((tmp_path / "image/model_dir").rglob("MLmodel")).parent
    assert (brought / "code/cylinder_friction/realtime/step.py").is_file()
    assert "numba==" in (brought / "requirements.txt").read_text()


@pytest.mark.parametrize("change", [{"pressure_1_pa": 1_000_000}, {"position_m": "0.12"}, {"position_m": True}])
def test_a_data_frame_that_is_not_of_doubles_is_refused_by_mlflow(
    golden_folder: Path, samples: np.ndarray, change: dict[str, object]
) -> None:
    rows = pd.DataFrame(samples, columns=list(SAMPLE_COLUMNS))
    model = mlflow.pyfunc.load_model(str(golden_folder))
    assert model.predict(rows.assign(velocity_m_s=0.0)).equals(model.predict(rows)), "an unknown column is dropped"
    with pytest.raises(MlflowException, match=f"Incompatible input types for column {next(iter(change))}"):
        model.predict(rows.assign(**change))
