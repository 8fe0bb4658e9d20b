"""The command ``ui``: open the MLflow UI on the runs."""

import argparse
from pathlib import Path

from cylinder_friction.deployment.mlflow_ui import run_ui


def run(options: argparse.Namespace) -> int:
    return run_ui(Path.cwd(), options.port)
