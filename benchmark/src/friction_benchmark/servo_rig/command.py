"""``friction-benchmark servo-rig``: its arguments, and what it prints. Imports nothing heavy until it runs."""

import argparse
from pathlib import Path

HELP = "score the product's estimators, trained there and elsewhere, on a simulated rig of another structure"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("--mounting", choices=("horizontal", "vertical"), default="horizontal")
    parser.add_argument("--sessions", type=int, default=6, help="of each of the three conditions, two of them for test")
    parser.add_argument("--duration-s", type=float, default=40.0, help="of a session")
    parser.add_argument("--epochs", type=int, default=40, help="of the hybrid's training")
    parser.add_argument("--twin-rigs", type=int, default=16, help="that the twin's hybrid is trained on; 0: without it")
    parser.add_argument("--seed", type=int, default=0, help="of everything that is drawn")
    elsewhere = "labelled recordings of the default rig; else some are simulated"
    parser.add_argument("--elsewhere", type=Path, metavar="FOLDER", help=elsewhere)


def run(options: argparse.Namespace) -> str:
    """Return the table."""
    from cylinder_friction.recordings.storage import read_stored
    from friction_benchmark.servo_rig.evaluation import EvaluationPlan, evaluate, table
    from friction_benchmark.servo_rig.sessions import SessionPlan

    sessions = SessionPlan(options.seed, options.sessions, options.duration_s, options.mounting)
    plan = EvaluationPlan(sessions, epochs=options.epochs, twin_rigs=options.twin_rigs)
    return table(evaluate(plan, None if options.elsewhere is None else read_stored(options.elsewhere)))
