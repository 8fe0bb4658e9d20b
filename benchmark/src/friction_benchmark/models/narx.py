"""NARX: polynomial in lagged features, linear in its parameters, fed with its own earlier estimates.

A term is a product of two columns, of which column 0 is one: ``(0, 0)`` is the constant, ``(i, 0)`` linear, ``(i, j)``
of second degree.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.estimators.training_plan import SequenceData
from friction_benchmark.evenly import evenly
from friction_benchmark.models.base import FeatureModel, Single
from friction_benchmark.models.lagged import Past
from friction_benchmark.models.robust_regression import robust_weights
from friction_benchmark.registry import BuildConfiguration, Int, RegisteredModel

Terms = NDArray[np.int64]

PAST = Past(lags=(4, 12, 40), averages=(100.0, 1000.0))  # 20, 60 and 200 ms ago; averages over 0.5 and 5 s
POLES = (0.0, 0.5, 0.8, 0.9, 0.95, 0.98)
"""How much of the last estimate may be kept: the greatest remembers for a quarter of a second."""
SMALL_RESIDUAL, PASSES = 0.2, 6
SEARCHED = 8  # Recordings that the poles are searched on
CLIP = 6.0  # Standard deviations at which a column is clipped: every term is bounded whatever the sensors give
COLLINEAR = 1e-8


class Narx(FeatureModel):
    """``y[k] = p[k] y[k-1] + (1 - p[k]) sum of theta_i term_i[k]`` with ``p[k] = a + (b - a) |v| / (|v| + v_c)``.

    So its own last estimate enters alone and times speed. It is stable whatever is put in: both poles, a at rest and b
    while sliding, lie in [0, 0.98], hence so does ``p``, and every term is bounded because every column is clipped.
    It is trained in free run, on its own estimates: at given poles the running model's output is linear in theta once
    the terms have passed the same poles, so least squares (reweighted towards least absolute error) gives the least
    error of the free run, and the poles are searched around it (separable least squares, Golub and Pereyra 1973).
    Which terms it has is decided by orthogonal forward regression. Effort cuts the rows, evenly spread, that the
    parameters are found on.

    Source: Ljung 1999, chapter 5 (NARX, output error); Billings 2013, chapters 2 and 3.
    """

    def __init__(self, build: BuildConfiguration) -> None:
        super().__init__(build)
        self.rows = build.share(120_000, 2000)
        self.at_rest, self.sliding = 0.0, 0.0

    def learn(self, train: Sequence[SequenceData]) -> None:
        """Search the poles on some recordings, then find terms and parameters on all."""
        few = evenly(train, SEARCHED)
        best, found = np.inf, (0.0, 0.0)
        for searched in ("sliding", "at_rest"):
            at_rest, sliding = found
            for pole in POLES:
                self.at_rest, self.sliding = (at_rest, pole) if searched == "sliding" else (pole, sliding)
                self._solve(few, self.rows // 4)
                error = self._error(few)
                if error < best:
                    best, found = error, (self.at_rest, self.sliding)
        self.at_rest, self.sliding = found
        self._solve(train, self.rows)

    def predict(self, features: Single) -> Array:
        """Return the model's output, fed with its own last output."""
        columns, kept = self._columns(features), self._kept(features)
        totals = (columns[:, self._terms[:, 0]] * columns[:, self._terms[:, 1]]) @ self._weights
        output = [totals[0]]
        for share, total in zip(kept[1:].tolist(), totals[1:].tolist(), strict=True):
            output.append(total + share * (output[-1] - total))
        return np.array(output)

    def model_multiply_adds(self) -> int:
        return 2 * len(self._weights) + 3 + PAST.multiply_adds(len(self.features.names))

    def _solve(self, sequences: Sequence[SequenceData], rows: int) -> None:
        every = max(1, sum(len(each.target) for each in sequences) // max(rows, 1))
        present = len(self.features.names)
        candidates = candidate_terms(present, PAST.width(present))
        design, target = [], []
        for each in sequences:
            filtered = filtered_terms(self._columns(each.features), candidates, self._kept(each.features), every)
            taken = slice(every - 1, every * len(filtered), every)
            usable = each.usable[taken]
            design.append(filtered[usable])
            target.append(each.target[taken][usable].astype(np.float64))
        regressors, wanted = np.concatenate(design), np.concatenate(target)
        chosen = chosen_terms(regressors.T @ regressors, regressors.T @ wanted, self.build.whole("terms"))
        self._terms = candidates[chosen]
        self._weights = robust_weights(np.ascontiguousarray(regressors[:, chosen]), wanted, SMALL_RESIDUAL, PASSES)

    def _error(self, sequences: Sequence[SequenceData]) -> float:
        errors = [np.abs(self.predict(each.features) - each.target)[each.usable] for each in sequences]
        return float(np.concatenate(errors).mean())

    def _columns(self, features: Single) -> Array:
        rows = np.clip(PAST.of(features).astype(np.float64), -CLIP, CLIP)
        return np.concatenate([np.ones((len(rows), 1)), rows], axis=1)

    def _kept(self, features: Single) -> Array:
        """Return how much of the last estimate is kept at each row, shape ``(n,)``."""
        creep = np.abs(self.column(features, "creep_velocity"))  # |v| / (|v| + v_c)
        return np.asarray(self.at_rest + (self.sliding - self.at_rest) * np.minimum(creep, 1.0))


def candidate_terms(present: int, columns: int) -> Terms:
    """Return, shape ``(m, 2)``: constant, every column, and every product of two of the first ``present`` columns."""
    linear = [(column, 0) for column in range(columns + 1)]
    products = [(first, second) for first in range(1, present + 1) for second in range(1, first + 1)]
    return np.array(linear + products, dtype=np.int64)


def chosen_terms(gram: Array, moment: Array, count: int) -> Terms:
    """Return the indices of ``count`` terms, each the one that explains most of the residual of those before it.

    Forward regression with orthogonal least squares by the error reduction ratio (Chen, Billings and Luo 1989; FROLS
    in Billings 2013), on products of regressors alone, with one another (``gram``) and with the target (``moment``):
    choosing a term removes its share from all others. There are fewer if the rest is collinear with those chosen.
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


def filtered_terms(columns: Array, terms: Terms, kept: Array, every: int) -> Array:
    """Return every ``every``-th row, the ``every``-th first, of terms filtered by the model's own poles.

    ``columns``, whose first is one, has shape ``(n, c)``; ``kept`` is how much of the last row is kept, shape ``(n,)``.
    """
    values = columns[:, terms[:, 0]] * columns[:, terms[:, 1]]
    for row in range(1, len(values)):
        values[row] += kept[row] * (values[row - 1] - values[row])
    return values[every - 1 :: every]


MODELS = (
    RegisteredModel(
        name="narx",
        title="NARX, polynomial, free running",
        family="modern",
        source="Ljung 1999; Billings 2013",
        build=Narx,
        space={"terms": (Int(20, 120), 60)},
        chosen="Second degree; terms by orthogonal forward regression; its last estimate is fed back with a weight in "
        "[0, 0.98] that depends on speed, so that it is stable whatever comes in; fitted in free run.",
    ),
)
