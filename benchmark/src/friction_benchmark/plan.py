"""The benchmark plan: which models are evaluated on which tasks, splits and seeds, and what each may spend."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from cylinder_friction.params.file import ParamsError
from cylinder_friction.recordings.columns import OIL_TEMPERATURE
from cylinder_friction.recordings.recording import RecordingError
from friction_benchmark.cases import Task
from friction_benchmark.datasets import Sources, folds_of, labelled_recordings
from friction_benchmark.folds import HELD_OUT, LEAVE_LOAD, LEAVE_TEMPERATURE, UNSEEN_RIG
from friction_benchmark.registry import MODULES, RegisteredModel, registered_models
from friction_benchmark.tasks import task_named


@dataclass(frozen=True)
class Plan:
    """What is evaluated."""

    tasks: Sequence[str]  # Names of tasks, all evaluated on held-out sessions
    splits: Mapping[str, Sequence[str]]  # For each other split the tasks that are evaluated on it
    seeds: Sequence[int]  # Of campaigns and models; models are tuned on the first
    effort: float  # Share of the full training, in (0, 1]
    trials: int  # Of every model's tuning
    models: Sequence[str] = ()  # Names of registered models; empty for all
    modules: Sequence[str] = MODULES  # Of the model registry

    def chosen_models(self) -> dict[str, RegisteredModel]:
        """Return the models by name, in the order of tables; raises ``ParamsError`` if one is not in the registry."""
        known = registered_models(self.modules)
        for name in self.models:
            if name not in known:
                expected = ", ".join(known)
                raise ParamsError(f"plan.models: no model {name!r} in the registry; expected some of {expected}")
        return {name: model for name, model in known.items() if name in self.models or not self.models}

    def leaderboards(self, sources: Sources) -> tuple[list[tuple[Task, str]], dict[str, str]]:
        """Return every task and split that the recordings allow, and why the others are missing."""
        pairs: list[tuple[Task, str]] = []
        missing: dict[str, str] = {}
        for task in map(task_named, self.tasks):
            if task.needs_truth and not sources.simulated:
                missing[task.name] = "it is scored against true friction, which is not known of one's own recordings"
            else:
                pairs.append((task, HELD_OUT))
        for split, names in self.splits.items():
            for task in [task for task, other in pairs if task.name in names and other == HELD_OUT]:
                problem = self._problem(sources, task, split)
                if problem:
                    missing[f"{task.name}, {split}"] = problem
                else:
                    pairs.append((task, split))
        return pairs, missing

    def _problem(self, sources: Sources, task: Task, split: str) -> str:
        """Return why a task cannot be evaluated on a split; empty where it can."""
        if split == UNSEEN_RIG and not sources.simulated:
            return "there are no recordings of another rig"
        labelled = labelled_recordings(sources, task.campaign, self.seeds[0]).values()
        recordings = [each.recording for each in labelled]
        if split == LEAVE_LOAD and len({recording.metadata.condition for recording in recordings}) < 2:
            return "all recordings are of one condition"
        if split == LEAVE_TEMPERATURE and any(OIL_TEMPERATURE not in each.columns for each in recordings):
            return "the oil's temperature was not measured"
        try:
            for seed in self.seeds:
                folds_of(sources, task, split, seed)
        except RecordingError as error:
            return str(error)
        return ""
