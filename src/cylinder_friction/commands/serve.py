"""The command ``serve``: serve a registered model and print a curl to try."""

import argparse
from pathlib import Path

from cylinder_friction.deployment.serve import run_server
from cylinder_friction.params.checking import load_params


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--model", help="models:/NAME@champion or models:/NAME/VERSION; default: the champion")


def run(options: argparse.Namespace) -> int:
    return run_server(options.model or f"models:/{load_params().registered_name}@champion", Path.cwd())
