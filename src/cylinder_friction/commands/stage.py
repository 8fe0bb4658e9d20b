"""The command ``stage``: run one stage of the pipeline."""

import argparse
import ast
from pathlib import Path

from cylinder_friction.run_record import STAGES
from cylinder_friction.tuning.study_store import StudyStoreError

EXPECTED = (StudyStoreError,)
_STAGES_FOLDER = Path(__file__).parents[1] / "stages"
_RESUMED = {"search": "finished trials", "train": "finished epochs", "baselines": "finished epochs"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    stages = "".join(f"\n- {name + ':':<11}{_words(name)}" for name in STAGES)
    parser.epilog = f"Stages, in the pipeline's order:\n{stages}"
    parser.add_argument("what", metavar="STAGE", choices=STAGES, help="one of the stages below")


def run(options: argparse.Namespace) -> None:
    from cylinder_friction.stages._run import run_stage

    run_stage(options.what)


def kept(options: argparse.Namespace) -> str:
    if options.what in _RESUMED:
        return f"{_RESUMED[options.what]} are kept in .cylinder-friction/resume; run `dvc repro` to go on from there"
    return "results of earlier stages are kept, and nothing is half-written; run `dvc repro` to run this stage again"


def _words(stage: str) -> str:
    """Return what a stage does, from the first line of its module, which need not be imported for it."""
    docstring = ast.get_docstring(ast.parse((_STAGES_FOLDER / f"{stage}.py").read_text(encoding="utf-8"))) or ""
    return docstring.splitlines()[0].partition(": ")[2].replace("``", "").rstrip(".")
