"""The command ``serve``: serve a registered model and print a curl to try."""

import argparse
from pathlib import Path

from cylinder_friction.deployment.serve import CHAMPION, run_server


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--model", default=CHAMPION)


def run(options: argparse.Namespace) -> int:
    return run_server(options.model, Path.cwd())
