"""The command ``check``: check ``params.yaml``."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cylinder_friction.params.checking import load_params

if TYPE_CHECKING:
    import argparse


def run(_options: argparse.Namespace) -> None:
    load_params()
