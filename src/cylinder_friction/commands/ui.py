"""The command ``ui``: open the MLflow UI on the runs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from cylinder_friction.deployment.serve import run_ui

if TYPE_CHECKING:
    import argparse


def run(_options: argparse.Namespace) -> int:
    return run_ui(Path.cwd())
