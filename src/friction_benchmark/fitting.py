"""A participant, taught once: who is made alike from alike recordings is taken from the store."""

from __future__ import annotations

import contextlib
import hashlib
import json
import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path
from time import process_time
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.recordings.files import read_json, write_json
from friction_benchmark.registry.model import BuildConfiguration

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.estimators.base import FrictionEstimator
    from cylinder_friction.recordings.recording import Recording
    from friction_benchmark.registry.model import RegisteredModel, Value

FIT_FILE = "fit.json"


@dataclass(frozen=True)
class Fitted:
    """An estimator that was taught, and the processor's time that it took [s]."""

    estimator: FrictionEstimator
    training_s: float


def fitted(
    entry: RegisteredModel,
    making: BuildConfiguration,
    recordings: Sequence[Recording],
    store: Path,
) -> Fitted:
    """Return a participant taught on these recordings, from the store if it was taught so before.

    What counts is what it is made from and what it sees: columns that are none of its inputs may differ, so that a
    model of position alone is identified once for many tasks. It is always read back from where it was saved.

    Args:
        entry: The participant.
        making: What it is made from.
        recordings: Labelled.
        store: Folder of the taught ones, by content.
    """
    estimator = entry.build(making)
    folder = store / _key(entry, making, estimator.inputs, recordings)
    if not folder.is_dir():
        before = process_time()
        estimator.fit(recordings)
        _keep(estimator, process_time() - before, folder)
    return Fitted(load_estimator(folder), float(read_json(folder / FIT_FILE)["training_s"]))


def making_of(
    entry: RegisteredModel,
    cylinder: Cylinder,
    inputs: tuple[str, ...],
    seed: int,
    effort: float,
    choice: Mapping[str, Value],
) -> BuildConfiguration:
    """Return what a participant is made from; what was not chosen is its first guess."""
    return BuildConfiguration(cylinder, inputs, seed, effort, {**entry.defaults, **choice})


def _keep(estimator: FrictionEstimator, training_s: float, folder: Path) -> None:
    """Save an estimator whole; of two processes that taught the same one, the first keeps it."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    draft = Path(tempfile.mkdtemp(prefix=f".{folder.name}.", dir=folder.parent))
    try:
        estimator.save(draft)
        write_json(draft / FIT_FILE, {"training_s": training_s})
        with contextlib.suppress(OSError):
            draft.rename(folder)
        if not folder.is_dir():
            raise OSError(f"{folder}: could not be made from {draft}")
    finally:
        shutil.rmtree(draft, ignore_errors=True)


def _key(
    entry: RegisteredModel, making: BuildConfiguration, inputs: Sequence[str], recordings: Sequence[Recording]
) -> str:
    told = {
        "entry": entry.name,
        "cylinder": repr(making.cylinder),
        "seed": making.seed,
        "effort": making.effort,
        "choice": dict(making.hyperparameters),
        "inputs": list(inputs),
    }
    digest = hashlib.sha256(json.dumps(told, sort_keys=True).encode())
    for recording in recordings:
        metadata = recording.metadata
        digest.update(f"{metadata.name}/{metadata.condition}/{metadata.session}/{metadata.sample_time_s}".encode())
        digest.update(recording.samples(inputs).tobytes())
        digest.update(np.packbits(recording.usable()).tobytes())
        digest.update(recording.column("friction_n")[recording.usable()].tobytes())
    return digest.hexdigest()[:32]
