"""The jobs of the benchmark, and the key of each: the hash of all that its result depends on.

That is the task and what its recordings are made from, the model with its hyperparameters, effort and seed, and the
source of every module that the worker and the model's module import. What is only shown (titles) does not count.
"""

from __future__ import annotations

import hashlib
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cylinder_friction.import_graph import module_path
from friction_benchmark.cache import Cache
from friction_benchmark.datasets import key_of, twin_kind, unseen_kind
from friction_benchmark.folds import HELD_OUT, LEAVE_LOAD, LEAVE_TEMPERATURE, UNSEEN_RIG
from friction_benchmark.source_code import PACKAGES, code_key

if TYPE_CHECKING:
    from friction_benchmark.cases import Task
    from friction_benchmark.datasets import Kind, Sources
    from friction_benchmark.registry.model import RegisteredModel, Values


@dataclass(frozen=True)
class Context:
    """What all jobs share.

    Attributes:
        sources: Where the recordings are.
        folder: Of the cache.
        effort: Share of the full training, in (0, 1].
        trials: Of every model's tuning.
        batch: How many of them are proposed at a time.
        code: Hash of the worker's code.
    """

    sources: Sources
    folder: Path
    effort: float
    trials: int
    batch: int
    code: str

    @property
    def cache(self) -> Cache:
        return Cache(self.folder)

    def key(self, model: RegisteredModel, code: str, task: Task, split: str, seed: int, **more: Any) -> str:
        """Return the key of a job of one model on one task, split and seed."""
        shown = ("title", "explanation", "baseline", "tuned_as")
        kinds: list[Kind] = [task.campaign]
        kinds += [unseen_kind(task)] if split == UNSEEN_RIG else []
        kinds += [twin_kind(task)] if model.trained_on == "twin" else []
        sizes = self.sources.sizes
        content = {
            "model": [model.name, code],
            "task": {name: value for name, value in asdict(task).items() if name not in shown},
            "split": [split, sizes.test_sessions, sizes.validation_sessions],
            "seed": seed,
            "recordings": [self.sources.key(kind, seed) for kind in kinds],
            "cylinder": asdict(self.sources.cylinder),
            "effort": self.effort,
            "worker": self.code,
        }
        return key_of({**content, **more})


@dataclass(frozen=True)
class TuningJob:
    """The tuning of one model for one task; ``code`` is the hash of the model's code."""

    model: RegisteredModel
    task: Task
    seed: int
    code: str

    def key(self, context: Context) -> str:
        budget = {"trials": context.trials, "batch": context.batch}
        return context.key(self.model, self.code, self.task, HELD_OUT, self.seed, **budget)

    def trial(self, hyperparameters: Values) -> TrialJob:
        return TrialJob(self.model, self.task, self.seed, hyperparameters, self.code)


@dataclass(frozen=True)
class TrialJob:
    """One trial of a tuning.

    Attributes:
        hyperparameters: By name.
        code: Hash of the model's code.
    """

    model: RegisteredModel
    task: Task
    seed: int
    hyperparameters: Values
    code: str

    def key(self, context: Context) -> str:
        chosen = dict(self.hyperparameters)
        return context.key(self.model, self.code, self.task, HELD_OUT, self.seed, hyperparameters=chosen)


@dataclass(frozen=True)
class PredictionJob:
    """The prediction of one model on one task, seed and fold of a split.

    Attributes:
        fold: Its number.
        hyperparameters: By name.
        timed: Whether the time of a step is measured.
        code: Hash of the model's code.
    """

    model: RegisteredModel
    task: Task
    split: str
    fold: int
    seed: int
    hyperparameters: Values
    timed: bool
    code: str

    def key(self, context: Context) -> str:
        more = {"fold": self.fold, "hyperparameters": dict(self.hyperparameters), "timed": self.timed}
        return context.key(self.model, self.code, self.task, self.split, self.seed, **more)

    def shared_fit(self) -> tuple[str, ...]:
        """Return what is equal of jobs that train the same: they are best done by one worker, one after another.

        Friction now is what an analytical model is identified on in every task; a model of the twin sees no recordings
        of the rig, so that it is the same in every fold.
        """
        task = self.task.campaign if self.model.family == "analytical" else self.task.name
        leaves_out = self.split in (LEAVE_LOAD, LEAVE_TEMPERATURE) and self.model.trained_on != "twin"
        return (self.model.name, str(self.seed), task, f"{self.split} {self.fold}" if leaves_out else "")


def model_code(module: str) -> str:
    """Return the hash of a registry module and all of the project that it imports; of a foreign module, of its file."""
    if module_path(module, PACKAGES) is not None:
        return code_key(module)
    spec = find_spec(module)
    if spec is None or spec.origin is None:
        raise ModuleNotFoundError(f"{module}: no such module of registered models")
    return hashlib.sha256(Path(spec.origin).read_bytes()).hexdigest()
