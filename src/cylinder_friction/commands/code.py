"""The command ``code``: write the hash of the code behind each stage into ``code.yaml``, which the stages depend on."""

import argparse
from importlib.metadata import version
from pathlib import Path

import yaml

from cylinder_friction.estimators.entry_points import own_code
from cylinder_friction.files.whole_files import write_text
from cylinder_friction.import_graph import code_key, remove_stale_machine_code
from cylinder_friction.params.checking import load_params
from cylinder_friction.params.file import IN_A_PROJECT, ParamsError
from cylinder_friction.run_record import STAGES
from cylinder_friction.tracking.repository import CODE_FILE

HEADER = (
    "# The version of the package and the hash of the code that each stage runs; `dvc repro` writes this file anew.\n"
)


def write_code(folder: Path) -> None:
    """Write ``code.yaml`` into a folder: after a change of code DVC runs exactly the stages whose entry has changed."""
    codes = {"cylinder-friction": version("cylinder-friction")}
    codes |= {stage: code_key(f"cylinder_friction.stages.{stage}") for stage in STAGES}
    for stage in ("baselines", "compare"):  # these stages make and load estimators of other packages
        codes[stage] += own_code()
    write_text(folder / CODE_FILE, HEADER + yaml.safe_dump(codes, sort_keys=False))


def run(_options: argparse.Namespace) -> None:
    folder = Path.cwd()
    if not (folder / "dvc.yaml").is_file():
        raise ParamsError(f"{folder / 'dvc.yaml'}: not there; {IN_A_PROJECT}")
    _refuse_missing_logs()
    remove_stale_machine_code()  # so that a stage runs the code of its hash
    write_code(folder)


def _refuse_missing_logs() -> None:
    """Refuse a configuration for own logs if these are missing, since DVC would only name the missing path."""
    params = load_params()
    source = Path(params.ingest.source)
    if params.record.recordings == 0 and not source.exists():
        raise ParamsError(
            f"{source} (ingest.source): no such folder; put your logs there, each file where ingest.name_pattern "
            f"({params.ingest.name_pattern}) finds its condition and session, or name the folder that holds them"
        )
