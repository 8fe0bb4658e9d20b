"""The command ``track``: log every finished stage to MLflow, without duplicates."""

import argparse
from pathlib import Path


def run(_options: argparse.Namespace) -> None:
    from cylinder_friction.tracking.replay import replay

    print(replay(Path.cwd()).summary())


def kept(_options: argparse.Namespace) -> str:
    return "runs that were logged whole are kept; run `cylinder-friction track` again for the others"
