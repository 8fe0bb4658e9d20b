"""The arguments of ``cylinder-friction live``; the module ``WORK`` runs it."""

import argparse
from pathlib import Path

HELP = "estimate friction of many cylinders in real time, with a page; try it with --replay LOGS"
WORK = "cylinder_friction_live.start"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--config", type=Path, help="file of settings; default: the settings as shipped")
    parser.add_argument("--model", help="folder of a saved estimator, or models:/NAME@ALIAS; overrides the settings")
    parser.add_argument("--port", type=int, help="port to listen on, 0 for a free one; overrides the settings")
    parser.add_argument("--folder", type=Path, help="folder of journal and history; overrides the settings")
    parser.add_argument("--stribeck", type=Path, help="Stribeck curves to draw, from `identify` or stage lugre")
    parser.add_argument("--replay", nargs="+", metavar="LOGS", help="logs to send: files, folders or patterns")
    parser.add_argument("--speed", type=float, default=1.0, help="speed of the replay; 0: unlimited; default: 1")
    parser.add_argument("--cylinder", help="cylinder of the replayed logs; default: that of params.yaml")
    parser.add_argument("--channels", type=Path, help="mapping of the replayed logs; default: guessed")
    parser.add_argument("--unit", action="append", default=[], help="unit that they do not state, as in `estimate`")
    parser.add_argument("--names", help="regular expression on a log's path, with the groups condition and session")
