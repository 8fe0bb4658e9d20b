"""The command ``lineage``: print and check the way back from a registered model to its data."""

import argparse
from pathlib import Path

from cylinder_friction.params.checking import load_params
from cylinder_friction.tracking.lineage import lineage


def run(options: argparse.Namespace) -> int:
    report = lineage(options.model or load_params().champion, Path.cwd())
    print(report.text())
    return 0 if report.holds else 1
