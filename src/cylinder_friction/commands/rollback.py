"""The command ``rollback``: make the previous champion the champion again, or any version."""

import argparse
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("model_name", nargs="?", help="name in the registry; default: that of params.yaml")
    parser.add_argument("--to", metavar="VERSION", type=int, help="version number; default: the previous champion")


def run(options: argparse.Namespace) -> None:
    from cylinder_friction.params.checking import load_params
    from cylinder_friction.tracking.registry import move_champion

    print(move_champion(Path.cwd(), options.model_name or load_params().registered_name, options.to))
