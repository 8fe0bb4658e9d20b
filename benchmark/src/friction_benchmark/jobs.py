"""The benchmark's piece of work, and its key: the hash of all that its result depends on.

That is the task and what its recordings are made from, the model with its hyperparameters, effort and seed, and the
source of every module that the worker and the model's module import. What is only shown (titles) does not count.
"""

import hashlib
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from pathlib import Path

from cylinder_friction import import_graph
from friction_benchmark.cache import Cache
from friction_benchmark.cases import Task
from friction_benchmark.datasets import Kind, Sources, key_of, twin_kind, unseen_kind
from friction_benchmark.folds import HELD_OUT, LEAVE_LOAD, LEAVE_TEMPERATURE, UNSEEN_RIG
from friction_benchmark.registry import RegisteredModel, Values

WORKER = "friction_benchmark.worker"
PACKAGES = {**import_graph.PACKAGES, "friction_benchmark": Path(__file__).parents[1]}


def code_key(*modules: str) -> str:
    """Return a hash over every file, of the benchmark and of the product, that decides what these modules do."""
    return import_graph.code_key(*modules, packages=PACKAGES)


@dataclass(frozen=True)
class Context:
    """What all jobs share."""

    sources: Sources  # Where the recordings are
    folder: Path  # Of the cache
    effort: float  # Share of the full training, in (0, 1]
    code: str  # Hash of the worker's code

    @property
    def cache(self) -> Cache:
        return Cache(self.folder)

    def refuse_other_code(self) -> None:
        """Raise ``RuntimeError`` if the work is for another version of the benchmark than is installed here."""
        if code_key(WORKER) != self.code:
            raise RuntimeError("the worker has another version of friction_benchmark; install the command's version")


@dataclass(frozen=True)
class Job:
    """One fit, validated and used to predict: one model on one task, seed and fold of a split."""

    model: RegisteredModel
    task: Task
    split: str
    fold: int  # Its number
    seed: int
    hyperparameters: Values  # By name
    code: str  # Hash of the model's code

    def key(self, context: Context) -> str:
        shown = ("title", "explanation", "baseline", "tuned_as")
        kinds: list[Kind] = [self.task.campaign]
        kinds += [unseen_kind(self.task)] if self.split == UNSEEN_RIG else []
        kinds += [twin_kind(self.task)] if self.model.trained_on == "twin" else []
        sizes = context.sources.sizes
        content = {
            "model": [self.model.name, self.code, dict(self.hyperparameters)],
            "task": {name: value for name, value in asdict(self.task).items() if name not in shown},
            "split": [self.split, self.fold, sizes.test_sessions, sizes.validation_sessions],
            "seed": self.seed,
            "recordings": [context.sources.key(kind, self.seed) for kind in kinds],
            "cylinder": context.sources.cylinder.to_dict(),
            "effort": context.effort,
            "worker": context.code,
        }
        return key_of(content)

    def shared_fit(self) -> tuple[str, ...]:
        """Return what is equal of jobs that train the same: one worker does them, one after another.

        Friction now is what an analytical model is identified on in every task. A model of the twin sees no recordings
        of the rig, so it is the same in every fold.
        """
        task = self.task.campaign if self.model.family == "analytical" else self.task.name
        leaves_out = self.split in (LEAVE_LOAD, LEAVE_TEMPERATURE) and self.model.trained_on != "twin"
        return (self.model.name, str(self.seed), task, f"{self.split} {self.fold}" if leaves_out else "")


def tuning_job(model: RegisteredModel, task: Task, seed: int, code: str) -> Job:
    """Return the job that the trials of a tuning vary: with the defaults, on held-out sessions."""
    return Job(model, task, HELD_OUT, 0, seed, model.defaults, code)


def model_code(module: str) -> str:
    """Return the hash of a model's module and all of the project that it imports; of a foreign module, of its file."""
    if import_graph.module_path(module, PACKAGES) is not None:
        return code_key(module)
    spec = find_spec(module)
    if spec is None or spec.origin is None:
        raise ModuleNotFoundError(f"{module}: no such module of registered models")
    return hashlib.sha256(Path(spec.origin).read_bytes()).hexdigest()
