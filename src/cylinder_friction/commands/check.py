"""The command ``check``: check ``params.yaml``."""

import argparse


def run(_options: argparse.Namespace) -> None:
    from cylinder_friction.params.checking import load_params

    load_params()
