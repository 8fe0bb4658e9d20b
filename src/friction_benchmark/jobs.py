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

from cylinder_friction.import_graph import code_key, module_path
from friction_benchmark.cache import Cache
from friction_benchmark.datasets import key_of, twin_kind, unseen_kind
from friction_benchmark.folds import HELD_OUT, UNSEEN_RIG

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
        code: Hash of the worker's code.
    """

    sources: Sources
    folder: Path
    effort: float
    trials: int
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
        return context.key(self.model, self.code, self.task, HELD_OUT, self.seed, trials=context.trials)


@dataclass(frozen=True)
class PredictionJob:
    """The prediction of one model on one task, split and seed.

    Attributes:
        hyperparameters: By name.
        timed: Whether the time of a step is measured.
        code: Hash of the model's code.
    """

    model: RegisteredModel
    task: Task
    split: str
    seed: int
    hyperparameters: Values
    timed: bool
    code: str

    def key(self, context: Context) -> str:
        chosen = dict(self.hyperparameters)
        return context.key(
            self.model, self.code, self.task, self.split, self.seed, hyperparameters=chosen, timed=self.timed
        )


def model_code(module: str) -> str:
    """Return the hash of a registry module and all of the project that it imports; of a foreign module, of its file."""
    if module_path(module) is not None:
        return code_key(module)
    spec = find_spec(module)
    if spec is None or spec.origin is None:
        raise ModuleNotFoundError(f"{module}: no such module of registered models")
    return hashlib.sha256(Path(spec.origin).read_bytes()).hexdigest()
