"""The arguments of ``cylinder-friction monitor``; the module ``WORK`` runs it."""

import argparse
from pathlib import Path
from typing import get_args

from cylinder_friction_monitoring.trends.assessment import EntryKind

HELP = "watch the trends of a fleet from its logs, each night only what is new, and raise alarms"
WORK = "cylinder_friction_monitoring.night"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add, kinds = parser.add_argument, ", ".join(get_args(EntryKind))
    words = "files, folders or patterns, of any supported format; without: assess again what is kept"
    add("logs", nargs="*", metavar="LOGS", help=words)
    words = "folder to write; default: health"
    add("--into", "--output", dest="into", type=Path, default=Path("health"), help=words)
    add("--fleet", type=Path, default=Path("fleet.yaml"), help="the cylinders; default: fleet.yaml")
    add("--workers", type=int, metavar="N", help="processes that work side by side; default: one per core")
    add("--json", action="store_true", help="print what health.json holds instead of lines")
    words = f"add what somebody did or stated about a cylinder, then assess it; KIND: {kinds}"
    add("--entry", nargs=2, metavar=("CYLINDER", "KIND"), help=words)
    add("--name", default="", help="who makes the entry")
    add("--words", default="", help="what the entry states")
    add("--time", help="when that was, such as 2026-03-01T14:30Z; default: now")
    add("--until", help="of acknowledge: when the alarm returns, such as 2026-06-01")
    words = "of withdraw: kind and time of the entry to withdraw, such as service 2026-03-01"
    add("--of", nargs=2, metavar=("KIND", "TIME"), help=words)
    words = "simulate a fleet into a folder, with its fleet.yaml, and monitor that; a few minutes"
    add("--demo", type=Path, metavar="FOLDER", help=words)
    add("--track", action="store_true", help="log sessions and baselines to MLflow")
