"""The command ``rollback``: make the previous champion the champion again, or any version."""

import argparse
from pathlib import Path

from cylinder_friction.params.checking import load_params
from cylinder_friction.tracking.registry import move_champion


def run(options: argparse.Namespace) -> None:
    print(move_champion(Path.cwd(), options.model_name or load_params().registered_name, options.to))
