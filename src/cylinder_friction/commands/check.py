"""The command ``check``: find what would make ``dvc repro`` fail, possibly after hours."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from cylinder_friction.deployment.brought_code import requirements_of
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.entry_points import own_class, own_kinds
from cylinder_friction.params.checking import Params, load_params
from cylinder_friction.params.file import PARAMS_FILE, ParamsError
from cylinder_friction.recordings.logs import NameRules
from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.refusal import RefusalError
from cylinder_friction.stages._stage import RIG_FOLDER, SERVABLE
from cylinder_friction.tracking.repository import asked_git


def run(_options: argparse.Namespace) -> None:
    if problems := [*problems_of(load_params())]:
        raise ParamsError(f"{PARAMS_FILE}: refused, nothing was run\n  " + "\n  ".join(problems))


def problems_of(params: Params) -> Iterator[str]:
    """Yield the problems of valid parameters on this machine and in this folder."""
    yield from _git()
    yield from _candidate(params.register_.candidate)
    for name, device in (("search", params.search.device), ("train", params.train.device)):
        if device == "cuda":
            import torch  # an extra, and slow

            if not torch.cuda.is_available():
                yield f"{name}.device: is 'cuda', but PyTorch finds no CUDA device; use 'auto' or 'cpu'"
    yield from _source(params)


def _source(params: Params) -> Iterator[str]:
    """Look at the files that ``ingest`` will read; earlier results may be of another source."""
    source, pattern = Path(params.ingest.source), params.ingest.pattern
    files = [path.relative_to(source).as_posix() for path in source.glob(pattern) if path.is_file()]
    made = source.is_relative_to(RIG_FOLDER) and params.record.recordings
    if not made and not files:
        yield f"ingest.source: {source} holds no file that matches {pattern!r} (ingest.pattern); put your logs there"
    conditions = set[str]()
    for file in files:
        with suppress(RecordingError):  # `ingest` puts this file into quarantine
            conditions.add(NameRules(params.ingest.name_pattern).names(file).condition)
    if conditions and params.lugre.condition not in conditions:
        yield (
            f"lugre.condition: expected one of {sorted(conditions)}, which ingest.name_pattern finds in {source}, "
            f"but got {params.lugre.condition!r}"
        )


def _candidate(name: str) -> Iterator[str]:
    own = {kind: own_class(entry) for kind, entry in own_kinds().items()}
    stepped = [*SERVABLE, *(kind for kind, each in own.items() if each.step_model is not FrictionEstimator.step_model)]
    if name not in stepped:
        yield (
            f"register.candidate: expected an estimator with a real-time step ({', '.join(stepped)}), but got {name!r}"
        )
    try:
        requirements_of(name)
    except RefusalError as error:
        yield f"register.candidate: {error}"


def _git() -> Iterator[str]:
    root, problem = asked_git(Path.cwd(), "rev-parse", "--show-toplevel")
    config = Path(".dvc/config")
    if root is None and not (config.is_file() and "no_scm = true" in config.read_text(encoding="utf-8")):
        yield (
            f"this folder: DVC needs Git, which refuses ({problem}); in a folder without a repository run `git init`, "
            "or write `no_scm = true` below [core] in .dvc/config: lineage then names no commit"
        )
