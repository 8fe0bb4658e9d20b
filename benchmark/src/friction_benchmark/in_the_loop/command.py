"""``friction-benchmark in-the-loop``: its arguments, what it prints and what it writes. Imports nothing heavy first."""

import argparse
from pathlib import Path

HELP = "close the servo rig's loop with and without friction fed forward, and print and draw what that is worth"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("--quick", action="store_true", help="a minute of everything, whose figures mean nothing")
    parser.add_argument("--output", type=Path, default=Path("reports/in_the_loop"), metavar="FOLDER")


def run(options: argparse.Namespace) -> str:
    """Run the experiment, write tables and picture into the folder, and return the tables as text."""
    from friction_benchmark.in_the_loop.experiment import QUICK, Plan, experiment
    from friction_benchmark.in_the_loop.report import write

    plan = QUICK if options.quick else Plan()
    return write(options.output, *experiment(plan))
