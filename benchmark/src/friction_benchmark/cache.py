"""The files in which predictions and scores are kept, each under the hash of all that it depends on: see ``jobs``.

Adding a model computes that model alone, a changed module recomputes the jobs that use it, and a benchmark that was
killed goes on where it was. ``prune`` removes what a run did not use.
"""

import os
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array, Mask
from cylinder_friction.files.whole_files import read_json, whole_file, write_json


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
    """One model on one task, split and seed, or a fold of that."""

    estimates: Mapping[str, Estimates]  # By the recording's name
    multiply_adds: int  # Of one sample
    training_s: float  # Of the processor, for all these folds together [s]
    step_us: float  # Processor time of one sample while whole recordings are estimated, median over recordings [µs]
    validation_percent: float  # MAE / mean |label| on the fold's validation sessions [%]


@dataclass(frozen=True)
class Cache:
    """A folder with one sub-folder per kind of result; reading a result marks it as used."""

    folder: Path

    def score(self, key: str) -> Any:
        """Return the line of a leaderboard; None if there is none."""
        path = self.folder / "scores" / f"{key}.json"
        return read_json(_mark_used(path)) if path.is_file() else None

    def keep_score(self, key: str, content: Any) -> None:
        write_json(self.folder / "scores" / f"{key}.json", content)

    def has_prediction(self, key: str) -> bool:
        path = self._prediction(key)
        return path.is_file() and bool(_mark_used(path))

    def keep_prediction(self, key: str, prediction: Prediction) -> None:
        """Write a prediction whole: first beside its place, then moved there."""
        figures = (prediction.multiply_adds, prediction.training_s, prediction.step_us, prediction.validation_percent)
        arrays: dict[str, Any] = {"figures": np.array(figures)}
        for name, estimates in prediction.estimates.items():
            numbers = np.stack([estimates.friction_n, estimates.lower_n, estimates.upper_n])
            arrays[f"numbers/{name}"] = numbers.astype(np.float32)
            arrays[f"outside/{name}"] = np.packbits(estimates.outside)
        with whole_file(self._prediction(key)) as draft:
            np.savez(draft, **arrays)

    def validation_percent(self, key: str) -> float:
        """Return what a kept prediction reached on its fold's validation sessions [%]."""
        with np.load(self._prediction(key)) as arrays:
            return float(arrays["figures"][3])

    def predictions(self, keys: Sequence[str]) -> Prediction:
        """Return the kept predictions of a split's folds as one; costs and validation are those of the last fold."""
        estimates: dict[str, Estimates] = {}
        training_s = 0.0
        for key in keys:
            with np.load(self._prediction(key)) as arrays:
                multiply_adds, fold_s, step_us, validation_percent = arrays["figures"].tolist()
                training_s += fold_s
                for name in (each.partition("/")[2] for each in arrays.files if each.startswith("numbers/")):
                    friction, lower, upper = arrays[f"numbers/{name}"].astype(np.float64)
                    outside = np.unpackbits(arrays[f"outside/{name}"], count=len(friction)).astype(np.bool_)
                    estimates[name] = Estimates(friction, lower, upper, outside)
        return Prediction(estimates, int(multiply_adds), training_s, step_us, validation_percent)

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


def _mark_used(path: Path) -> Path:
    """Return the path; its time of change is now, by which ``prune`` goes."""
    os.utime(path)
    return path
