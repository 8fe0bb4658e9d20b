"""The command ``code``: write down which code the installed package runs, for DVC in a project that holds no source."""

import argparse
from importlib.metadata import version
from pathlib import Path

import yaml

from cylinder_friction.import_graph import code_key
from cylinder_friction.recordings.files import write_text
from cylinder_friction.run_record import STAGES
from cylinder_friction.tracking.repository import CODE_FILE

HEADER = "# The installed package and the hash of the code that each stage runs in it; `dvc repro` writes it anew.\n"


def write_code(folder: Path) -> None:
    """Write ``code.yaml``: after an upgrade the stages run again whose code is another one, and only those."""
    codes = {"cylinder-friction": version("cylinder-friction")}
    codes |= {stage: code_key(f"cylinder_friction.stages.{stage}") for stage in STAGES}
    write_text(folder / CODE_FILE, HEADER + yaml.safe_dump(codes, sort_keys=False))


def run(_options: argparse.Namespace) -> None:
    write_code(Path.cwd())
