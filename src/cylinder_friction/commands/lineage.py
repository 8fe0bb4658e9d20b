"""The command ``lineage``: print and check the way back from a registered model to its data."""

import argparse
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("model", nargs="?", help="models:/NAME@champion or models:/NAME/VERSION; default: the champion")


def run(options: argparse.Namespace) -> int:
    from cylinder_friction.params.checking import load_params
    from cylinder_friction.tracking.lineage import lineage

    report = lineage(options.model or load_params().champion, Path.cwd())
    print(report.text())
    return 0 if report.holds else 1
