"""The command ``stage``: run one stage of the pipeline."""

import argparse

from cylinder_friction.stages._run import run_stage

_RESUMED = {"search": "finished trials", "train": "finished epochs", "baselines": "finished epochs"}


def run(options: argparse.Namespace) -> None:
    run_stage(options.what)


def kept(options: argparse.Namespace) -> str:
    if options.what in _RESUMED:
        return f"{_RESUMED[options.what]} are kept in .cylinder-friction/resume; run `dvc repro` to go on from there"
    return "results of earlier stages are kept, and nothing is half-written; run `dvc repro` to run this stage again"
