"""What is finished stays: tunings and answers in a folder, so that an interrupted benchmark goes on where it was."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from cylinder_friction.recordings.files import read_json, write_json
from friction_benchmark.tuning import Tuned

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    from cylinder_friction.evaluation.bootstrap import Array


@dataclass(frozen=True, eq=False)
class Estimates:
    """What a model said of one recording, shape ``(n,)`` each: friction and bounds [N], and the flag."""

    friction_n: Array
    lower_n: Array
    upper_n: Array
    outside: NDArray[np.bool_]

    def hold(self, values_n: Array) -> NDArray[np.bool_]:
        """Return where the bounds hold these values [N], shape ``(n,)``."""
        return np.asarray((values_n >= self.lower_n) & (values_n <= self.upper_n))


@dataclass(frozen=True, eq=False)
class Answer:
    """One model on one task, split and seed.

    Attributes:
        estimates: By the recording's name.
        multiply_adds: Of one step.
        training_s: Of the processor, for all folds together [s].
        step_us: Median time of one step [µs]; None where it was not measured.
    """

    estimates: Mapping[str, Estimates]
    multiply_adds: int
    training_s: float
    step_us: float | None = field(default=None)


@dataclass(frozen=True)
class Store:
    """Folder of a benchmark that may have been interrupted."""

    folder: Path

    @property
    def fits(self) -> Path:
        return self.folder / "fits"

    def tuned(self, task: str, model: str) -> Tuned | None:
        path = self._tuning(task, model)
        if not path.is_file():
            return None
        content = read_json(path)
        return Tuned(content["choice"], content["validation_percent"], tuple(content["trials"]))

    def keep_tuned(self, task: str, model: str, tuned: Tuned) -> None:
        write_json(self._tuning(task, model), asdict(tuned))

    def has_answer(self, task: str, split: str, model: str, seed: int) -> bool:
        return self._answer(task, split, model, seed).with_suffix(".json").is_file()

    def keep_answer(self, task: str, split: str, model: str, seed: int, answer: Answer) -> None:
        """Write the numbers first, then what makes the answer count as there."""
        path = self._answer(task, split, model, seed)
        path.parent.mkdir(parents=True, exist_ok=True)
        arrays: dict[str, Any] = {}
        for name, estimates in answer.estimates.items():
            numbers = np.stack([estimates.friction_n, estimates.lower_n, estimates.upper_n])
            arrays[f"numbers/{name}"] = numbers.astype(np.float32)
            arrays[f"outside/{name}"] = np.packbits(estimates.outside)
        np.savez(path.with_suffix(".npz"), **arrays)
        costs = {"multiply_adds": answer.multiply_adds, "training_s": answer.training_s, "step_us": answer.step_us}
        write_json(path.with_suffix(".json"), {"recordings": list(answer.estimates), **costs})

    def answer(self, task: str, split: str, model: str, seed: int) -> Answer:
        path = self._answer(task, split, model, seed)
        about = read_json(path.with_suffix(".json"))
        estimates: dict[str, Estimates] = {}
        with np.load(path.with_suffix(".npz")) as arrays:
            for name in about.pop("recordings"):
                friction, lower, upper = arrays[f"numbers/{name}"].astype(np.float64)
                outside = np.unpackbits(arrays[f"outside/{name}"], count=len(friction)).astype(np.bool_)
                estimates[name] = Estimates(friction, lower, upper, outside)
        return Answer(estimates, **about)

    def _tuning(self, task: str, model: str) -> Path:
        return self.folder / "tuning" / task / f"{model}.json"

    def _answer(self, task: str, split: str, model: str, seed: int) -> Path:
        return self.folder / "answers" / task / split / f"{model}-{seed}"
