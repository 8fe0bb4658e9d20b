"""The command ``check``: check ``params.yaml``."""

import argparse

from cylinder_friction.params.checking import load_params


def run(_options: argparse.Namespace) -> None:
    load_params()
