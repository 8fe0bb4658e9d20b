"""NARX: polynomial in lagged features, linear in its parameters, fed with its own earlier estimates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from friction_benchmark.models.lagged import Past, PastMemory
from friction_benchmark.models.learned import LearnedEstimator
from friction_benchmark.models.narx_terms import (
    CLIP,
    candidate_terms,
    chosen_terms,
    filtered_terms,
    free_run,
    poles,
)

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.estimators.base import Array
    from cylinder_friction.estimators.training_plan import SequenceData

PAST = Past(lags=(4, 12, 40), averages=(100.0, 1000.0))
"""20, 60 and 200 ms ago; averages over 0.5 and 5 s."""
POLES = (0.0, 0.5, 0.8, 0.9, 0.95, 0.98)
"""How much of the last estimate may be kept: the greatest remembers for a quarter of a second."""
SMALL_RESIDUAL = 0.2
PASSES = 6
SEARCHED = 8


@dataclass
class NarxMemory:
    """Memory of the lags, and the last estimate, shape ``(1,)``."""

    past: PastMemory
    last: Array


class NarxEstimator(LearnedEstimator):
    """``y[k] = p[k] y[k-1] + (1 - p[k]) sum of theta_i term_i[k]`` with ``p[k] = a + (b - a) |v| / (|v| + v_c)``.

    So its own last estimate enters alone and times speed. It is stable whatever is put in: both poles, a at rest and b
    while sliding, lie in [0, 0.98], hence so does ``p``, and every term is bounded because every column is cut off.
    It is taught as it runs, on its own estimates: at given poles the running model's output is linear in theta once
    the terms have passed the same poles, so least squares (reweighted towards least absolute error) gives the least
    error of the free run, and the poles are searched around it (separable least squares, Golub and Pereyra 1973).
    Which terms it has is decided by orthogonal forward regression.

    Args:
        cylinder: Its areas.
        inputs: Columns that it sees.
        terms: Number of terms.
        rows: How many rows, evenly spread, the parameters are found on.
        past: Which earlier features it is given.
        seed: Nothing is random; kept for its like.

    Source: Ljung 1999, chapter 5 (NARX, output error); Billings 2013, chapters 2 and 3.
    """

    kind: ClassVar[str] = "narx"

    def __init__(
        self,
        cylinder: Cylinder,
        inputs: Sequence[str] = SAMPLE_COLUMNS,
        terms: int = 80,
        rows: int = 60_000,
        past: Past = PAST,
        seed: int = 0,
    ) -> None:
        super().__init__(cylinder, inputs, seed)
        if terms < 1 or rows < 1:
            raise ValueError(f"expected at least one term and row, but got {terms} terms and {rows} rows")
        self.terms, self.rows, self.past = terms, rows, past
        self.at_rest, self.sliding = 0.0, 0.0
        self._terms = np.zeros((1, 2), dtype=np.int64)
        self._weights = np.zeros(1)

    def learn(self, train: Sequence[SequenceData]) -> None:
        """Find poles on some recordings, then terms and parameters on all."""
        few = [train[int(number * len(train) / SEARCHED)] for number in range(min(SEARCHED, len(train)))]
        best = np.inf
        at_rest, sliding = self.at_rest, self.sliding
        for name in ("sliding", "at_rest"):
            for pole in POLES:
                self.at_rest = pole if name == "at_rest" else at_rest
                self.sliding = pole if name == "sliding" else sliding
                self._solve(few, self.rows // 4)
                error = self._error(few)
                if error < best:
                    best, found = error, (self.at_rest, self.sliding)
            at_rest, sliding = found
        self.at_rest, self.sliding = at_rest, sliding
        self._solve(train, self.rows)

    def _solve(self, sequences: Sequence[SequenceData], rows: int) -> None:
        total = sum(len(each.target) for each in sequences)
        every = max(1, total // max(rows, 1))
        assert self.features is not None
        present = len(self.features.names)
        candidates = candidate_terms(present, self.past.width(present))
        design, target = [], []
        for each in sequences:
            columns = self._columns(self.past.new_memory(), each.features)
            regressors = filtered_terms(columns, candidates, self._kept(each.features), every)
            taken = slice(every - 1, every * len(regressors), every)
            usable = each.usable[taken]
            design.append(regressors[usable])
            target.append(each.target[taken][usable].astype(np.float64))
        regressors, wanted = np.concatenate(design), np.concatenate(target)
        chosen = chosen_terms(regressors.T @ regressors, regressors.T @ wanted, self.terms)
        self._terms = np.ascontiguousarray(candidates[chosen])
        self._weights = _robust(np.ascontiguousarray(regressors[:, chosen]), wanted)

    def _error(self, sequences: Sequence[SequenceData]) -> float:
        errors = [
            np.abs(self.predict(self.new_memory(), each.features) - each.target)[each.usable] for each in sequences
        ]
        return float(np.concatenate(errors).mean())

    def _columns(self, memory: PastMemory, features: NDArray[np.float32]) -> Array:
        rows = np.clip(self.past.advance(memory, features).astype(np.float64), -CLIP, CLIP)
        return np.concatenate([np.ones((len(rows), 1)), rows], axis=1)

    def _kept(self, features: NDArray[np.float32]) -> Array:
        assert self.features is not None
        front_end = self.features.front_end
        column = front_end.names.index("creep_velocity")
        creep = features[:, column].astype(np.float64) * front_end.scale[column] + front_end.mean[column]
        return np.asarray(poles(creep, self.at_rest, self.sliding))

    def new_memory(self) -> NarxMemory:
        return NarxMemory(self.past.new_memory(), np.full(1, np.nan))

    def predict(self, memory: NarxMemory, features: NDArray[np.float32]) -> NDArray[Any]:
        columns = self._columns(memory.past, features)
        return np.asarray(free_run(columns, self._terms, self._weights, self._kept(features), memory.last))

    def model_multiply_adds(self) -> int:
        assert self.features is not None
        return 2 * len(self._weights) + 3 + self.past.multiply_adds(len(self.features.names))

    def write_model(self, folder: Path) -> dict[str, Any]:  # noqa: ARG002 - everything is JSON
        return {
            "terms": self.terms,
            "rows": self.rows,
            "past": self.past.to_dict(),
            "seed": self.seed,
            "pole_at_rest": self.at_rest,
            "pole_sliding": self.sliding,
            "columns": self._terms.tolist(),
            "weights": self._weights.tolist(),
        }

    @classmethod
    def read_model(cls, folder: Path, content: dict[str, Any], cylinder: Cylinder, inputs: Sequence[str]) -> Self:  # noqa: ARG003
        past = Past.from_dict(content["past"])
        estimator = cls(cylinder, inputs, content["terms"], content["rows"], past, content["seed"])
        estimator.at_rest, estimator.sliding = content["pole_at_rest"], content["pole_sliding"]
        estimator._terms = np.array(content["columns"], dtype=np.int64)
        estimator._weights = np.array(content["weights"])
        return estimator


def _robust(design: Array, target: Array) -> Array:
    """Return weights near to least absolute error: squares within ``SMALL_RESIDUAL``, absolute beyond."""
    scale = np.sqrt((design**2).mean(axis=0)) + 1e-12
    scaled = design / scale
    importance = np.ones(len(target))
    found = np.zeros(design.shape[1])
    for _ in range(PASSES):
        weighted = scaled * importance[:, None]
        gram = weighted.T @ scaled
        found = np.linalg.solve(gram + 1e-6 * np.trace(gram) / len(gram) * np.eye(len(gram)), weighted.T @ target)
        importance = SMALL_RESIDUAL / np.maximum(SMALL_RESIDUAL, np.abs(target - scaled @ found))
    return np.asarray(found / scale)
