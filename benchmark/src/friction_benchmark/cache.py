"""What is computed is kept, each piece under the hash of all that it depends on: see ``jobs``.

Adding a model computes that model alone, a changed module recomputes the jobs that use it, and a benchmark that was
killed goes on where it was. ``prune`` removes what a run did not use.
"""

from __future__ import annotations

import os
import shutil
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from cylinder_friction.recordings.files import read_json, whole_file, write_json
from friction_benchmark.tuning import Tuned

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from cylinder_friction.arrays import Array, Mask


@dataclass(frozen=True, eq=False)
class Estimates:
    """A model's estimates for one recording, shape ``(n,)`` each: friction and bounds [N], and the flag."""

    friction_n: Array
    lower_n: Array
    upper_n: Array
    outside: NDArray[np.bool_]

    def hold(self, values_n: Array) -> Mask:
        """Return where the bounds hold these values [N], shape ``(n,)``."""
        return np.asarray((values_n >= self.lower_n) & (values_n <= self.upper_n))


@dataclass(frozen=True, eq=False)
class Prediction:
    """One model on one task, split and seed, or a fold of that.

    Attributes:
        estimates: By the recording's name.
        multiply_adds: Of one step.
        training_s: Of the processor, for all these folds together [s].
        step_us: Median time of one step [µs]; None where it was not measured.
    """

    estimates: Mapping[str, Estimates]
    multiply_adds: int
    training_s: float
    step_us: float | None = None


@dataclass(frozen=True)
class Cache:
    """A folder with one sub-folder per kind of result; reading a result marks it as used."""

    folder: Path

    @property
    def campaigns(self) -> Path:
        return self.folder / "campaigns"

    @property
    def fits(self) -> Path:
        return self.folder / "fits"

    def tuned(self, key: str) -> Tuned | None:
        content = self.value("tunings", key)
        return None if content is None else Tuned(**{**content, "trials": tuple(content["trials"])})

    def keep_tuned(self, key: str, tuned: Tuned) -> None:
        self.keep_value("tunings", key, asdict(tuned))

    def value(self, kind: str, key: str) -> Any:
        """Return what JSON holds under a key; None where there is nothing."""
        path = self.folder / kind / f"{key}.json"
        return read_json(mark_used(path)) if path.is_file() else None

    def keep_value(self, kind: str, key: str, content: Any) -> None:
        write_json(self.folder / kind / f"{key}.json", content)

    def has_prediction(self, key: str) -> bool:
        path = self._prediction(key)
        return path.is_file() and bool(mark_used(path))

    def keep_prediction(self, key: str, prediction: Prediction) -> None:
        """Write a prediction whole: first beside its place, then moved there."""
        step_us = np.nan if prediction.step_us is None else prediction.step_us
        arrays: dict[str, Any] = {"costs": np.array([prediction.multiply_adds, prediction.training_s, step_us])}
        for name, estimates in prediction.estimates.items():
            numbers = np.stack([estimates.friction_n, estimates.lower_n, estimates.upper_n])
            arrays[f"numbers/{name}"] = numbers.astype(np.float32)
            arrays[f"outside/{name}"] = np.packbits(estimates.outside)
        with whole_file(self._prediction(key)) as draft:
            np.savez(draft, **arrays)

    def predictions(self, keys: Sequence[str]) -> Prediction:
        """Return the predictions of a split's folds as one."""
        folds = [self.prediction(key) for key in keys]
        estimates = {name: one for fold in folds for name, one in fold.estimates.items()}
        training_s = sum(fold.training_s for fold in folds)
        return Prediction(estimates, folds[-1].multiply_adds, training_s, folds[-1].step_us)

    def prediction(self, key: str) -> Prediction:
        estimates: dict[str, Estimates] = {}
        with np.load(self._prediction(key)) as arrays:
            multiply_adds, training_s, step_us = map(float, arrays["costs"])
            for name in (each.partition("/")[2] for each in arrays.files if each.startswith("numbers/")):
                friction, lower, upper = arrays[f"numbers/{name}"].astype(np.float64)
                outside = np.unpackbits(arrays[f"outside/{name}"], count=len(friction)).astype(np.bool_)
                estimates[name] = Estimates(friction, lower, upper, outside)
        return Prediction(estimates, int(multiply_adds), training_s, None if np.isnan(step_us) else step_us)

    def prune(self, since_s: float) -> int:
        """Remove what was neither made nor used since a point in time (``time.time()``); return how many entries."""
        unused = [path for path in self.folder.glob("*/*") if path.stat().st_mtime < since_s]
        for path in unused:
            if path.is_dir():
                shutil.rmtree(path)
            else:
                path.unlink()
        return len(unused)

    def _prediction(self, key: str) -> Path:
        return self.folder / "predictions" / f"{key}.npz"


def mark_used(path: Path) -> Path:
    """Return the path; its time of change is now, by which ``prune`` goes."""
    os.utime(path)
    return path
