"""The command ``track``: log every finished stage to MLflow, without duplicates."""

import argparse
from pathlib import Path

from cylinder_friction.tracking.registry import track


def run(_options: argparse.Namespace) -> int:
    tracked = track(Path.cwd())
    print(tracked.summary())
    return 1 if tracked.problems else 0


def kept(_options: argparse.Namespace) -> str:
    return "runs that were logged whole are kept; run `cylinder-friction track` again for the others"
