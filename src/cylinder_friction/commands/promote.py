"""The command ``promote``: make a version of a registered model the champion."""

import argparse
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("version", type=int, help="version number")
    parser.add_argument("model_name", nargs="?", help="name in the registry; default: that of params.yaml")


def run(options: argparse.Namespace) -> None:
    from cylinder_friction.params.checking import load_params
    from cylinder_friction.tracking.registry import move_champion

    print(move_champion(Path.cwd(), options.model_name or load_params().registered_name, options.version))
