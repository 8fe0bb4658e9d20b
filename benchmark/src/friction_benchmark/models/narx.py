"""NARX: polynomial in lagged features, linear in its parameters, fed with its own earlier estimates.

A term is a product of two columns, of which column 0 is one: ``(0, 0)`` is the constant, ``(i, 0)`` linear, ``(i, j)``
of second degree.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numba
import numpy as np

from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from friction_benchmark.evenly import evenly
from friction_benchmark.models.lagged import Past, PastMemory
from friction_benchmark.models.learned import LearnedEstimator
from friction_benchmark.models.robust_regression import robust_weights

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from cylinder_friction.arrays import Array
    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.estimators.training_plan import SequenceData

    Terms = NDArray[np.int64]

PAST = Past(lags=(4, 12, 40), averages=(100.0, 1000.0))
"""20, 60 and 200 ms ago; averages over 0.5 and 5 s."""
POLES = (0.0, 0.5, 0.8, 0.9, 0.95, 0.98)
"""How much of the last estimate may be kept: the greatest remembers for a quarter of a second."""
SMALL_RESIDUAL, PASSES = 0.2, 6
SEARCHED = 8
"""Recordings that the poles are searched on."""
CLIP = 6.0
"""Standard deviations at which a column is clipped: every term is bounded whatever the sensors give."""
COLLINEAR = 1e-8


@dataclass
class NarxMemory:
    """Memory of the lags, and the last estimate, shape ``(1,)``, NaN at first."""

    past: PastMemory
    last: Array


class NarxEstimator(LearnedEstimator):
    """``y[k] = p[k] y[k-1] + (1 - p[k]) sum of theta_i term_i[k]`` with ``p[k] = a + (b - a) |v| / (|v| + v_c)``.

    So its own last estimate enters alone and times speed. It is stable whatever is put in: both poles, a at rest and b
    while sliding, lie in [0, 0.98], hence so does ``p``, and every term is bounded because every column is clipped.
    It is trained in free run, on its own estimates: at given poles the running model's output is linear in theta once
    the terms have passed the same poles, so least squares (reweighted towards least absolute error) gives the least
    error of the free run, and the poles are searched around it (separable least squares, Golub and Pereyra 1973).
    Which terms it has is decided by orthogonal forward regression.

    Args:
        terms: Number of terms.
        rows: How many rows, evenly spread, the parameters are found on.
        past: Which earlier features it is given.

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
    ) -> None:
        super().__init__(cylinder, inputs)
        if terms < 1 or rows < 1:
            raise ValueError(f"expected at least one term and row, but got {terms} terms and {rows} rows")
        self.terms, self.rows, self.past = terms, rows, past
        self.at_rest, self.sliding = 0.0, 0.0
        self._terms = np.zeros((1, 2), dtype=np.int64)
        self._weights = np.zeros(1)

    def learn(self, train: Sequence[SequenceData]) -> None:
        """Search the poles on some recordings, then find terms and parameters on all."""
        few = evenly(train, SEARCHED)
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
        self._weights = robust_weights(np.ascontiguousarray(regressors[:, chosen]), wanted, SMALL_RESIDUAL, PASSES)

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
        front_end = self.features
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
        settings = {"terms": self.terms, "rows": self.rows, "past": asdict(self.past)}
        poles = {"pole_at_rest": self.at_rest, "pole_sliding": self.sliding}
        return {**settings, **poles, "columns": self._terms.tolist(), "weights": self._weights.tolist()}

    @classmethod
    def read_model(cls, folder: Path, content: dict[str, Any], cylinder: Cylinder, inputs: Sequence[str]) -> Self:  # noqa: ARG003
        estimator = cls(cylinder, inputs, content["terms"], content["rows"], Past(**content["past"]))
        estimator.at_rest, estimator.sliding = content["pole_at_rest"], content["pole_sliding"]
        estimator._terms = np.array(content["columns"], dtype=np.int64)
        estimator._weights = np.array(content["weights"])
        return estimator


def candidate_terms(present: int, columns: int) -> Terms:
    """Return, shape ``(m, 2)``: constant, every column, and every product of two of the first ``present`` columns."""
    linear = [(column, 0) for column in range(columns + 1)]
    products = [(first, second) for first in range(1, present + 1) for second in range(1, first + 1)]
    return np.array(linear + products, dtype=np.int64)


def chosen_terms(gram: Array, moment: Array, count: int) -> Terms:
    """Return the indices of ``count`` terms, each the one that explains most of the residual of those before it.

    Forward regression with orthogonal least squares by the error reduction ratio (Chen, Billings and Luo 1989; FROLS
    in Billings 2013), on products of regressors alone: choosing a term removes its share from all others.

    Args:
        gram: Regressors' products with one another, shape ``(m, m)``.
        moment: Their products with the target, shape ``(m,)``.
        count: Of terms, at most; fewer where the rest is collinear with those chosen.
    """
    left, explained = gram.copy(), moment.copy()
    own = np.maximum(np.diag(gram).copy(), 1e-300)
    free = np.ones(len(moment), dtype=np.bool_)
    chosen: list[int] = []
    for _ in range(min(count, len(moment))):
        usable = free & (np.diag(left) > COLLINEAR * own)
        if not usable.any():
            break
        gain = np.where(usable, explained**2 / np.where(usable, np.diag(left), 1.0), -1.0)
        best = int(np.argmax(gain))
        direction = left[:, best] / left[best, best]
        explained = explained - direction * explained[best]
        left = left - np.outer(direction, left[best])
        free[best] = False
        chosen.append(best)
    return np.array(chosen, dtype=np.int64)


@numba.njit(cache=True)
def poles(creep: Array, at_rest: float, sliding: float) -> Array:
    """Return how much of the last estimate is kept, shape ``(n,)``, for ``creep = v / (|v| + v_c)``, in [-1, 1]."""
    return at_rest + (sliding - at_rest) * np.minimum(np.abs(creep), 1.0)


@numba.njit(cache=True)
def filtered_terms(columns: Array, terms: Terms, kept: Array, every: int) -> Array:
    """Return every ``every``-th row, the ``every``-th first, of terms filtered by the model's own poles.

    Args:
        columns: Shape ``(n, c)``, column 0 one.
        terms: Shape ``(m, 2)``.
        kept: From ``poles``, shape ``(n,)``.
        every: Rows per returned row.
    """
    result = np.empty((columns.shape[0] // every, terms.shape[0]))
    state = np.zeros(terms.shape[0])
    for row in range(columns.shape[0]):
        for term in range(terms.shape[0]):
            value = columns[row, terms[term, 0]] * columns[row, terms[term, 1]]
            state[term] = value if row == 0 else kept[row] * state[term] + (1.0 - kept[row]) * value
        if (row + 1) % every == 0:
            result[row // every] = state
    return result


@numba.njit(cache=True)
def free_run(columns: Array, terms: Terms, weights: Array, kept: Array, state: Array) -> Array:
    """Return the model's output, fed with its own last output, shape ``(n,)``; ``state`` is that, NaN at first."""
    result = np.empty(columns.shape[0])
    for row in range(columns.shape[0]):
        total = 0.0
        for term in range(terms.shape[0]):
            total += weights[term] * columns[row, terms[term, 0]] * columns[row, terms[term, 1]]
        state[0] = total if np.isnan(state[0]) else kept[row] * state[0] + (1.0 - kept[row]) * total
        result[row] = state[0]
    return result
