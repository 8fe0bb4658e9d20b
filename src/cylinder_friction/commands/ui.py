"""The command ``ui``: open the MLflow UI on the runs."""

import argparse
from pathlib import Path

from cylinder_friction.deployment.mlflow_ui import run_ui


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--port", type=int, help="port on this machine; default: a free one")


def run(options: argparse.Namespace) -> int:
    return run_ui(Path.cwd(), options.port)
