"""Rows in, friction out: what the served model does with a table, and what it refuses."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from cylinder_friction.recordings.columns import SAMPLE_COLUMNS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cylinder_friction.estimators.base import FrictionEstimator

RECORDING_COLUMN = "recording"
FRICTION_COLUMN = "friction_n"
IN_RANGE_COLUMN = "in_training_range"
MEMORY_S = 1.0
"""How long a sample outside the training range keeps casting doubt on what follows: filters and network remember it."""


class ScoringError(ValueError):
    """Rows that cannot be scored; the message says which, found, expected and what to do."""


def score(estimator: FrictionEstimator, rows: pd.DataFrame) -> pd.DataFrame:
    """Return one row out for each row in, in their order.

    Args:
        estimator: A loaded estimator.
        rows: Raw samples, ``pressure_1_pa``, ``pressure_2_pa`` (gauge) and ``position_m`` (extension positive), at the
            sample time the estimator was trained at. With a column ``recording`` each of its values is a sequence of
            its own, in row order, and rows of different recordings may alternate; without it all rows are one.

    Returns:
        ``friction_n``: friction [N], positive when it opposes positive velocity. ``in_training_range``: whether this
        row and all rows of its recording in the second before it lie where the estimator was trained (5 % wider);
        where not, the friction is an extrapolation.

    Raises:
        ScoringError: There is no row, a column is missing or not numeric, a value is NaN or infinite or so large that
            no finite estimate follows, or a recording has no name.
    """
    samples = _checked_samples(rows)
    names = _checked_names(rows)
    assert estimator.training_range is not None
    assert estimator.sample_time_s is not None
    memory = max(1, round(MEMORY_S / estimator.sample_time_s))
    inside = estimator.training_range.holds(samples)
    friction_n = np.empty(len(samples))
    trusted = np.empty(len(samples), dtype=np.bool_)
    for positions in pd.Series(range(len(samples))).groupby(names, sort=False).indices.values():
        with np.errstate(all="ignore"):  # what overflows is refused below, by row
            friction_n[positions] = estimator.advance(estimator.new_state(), samples[positions])
        trusted[positions] = _no_doubt_within(inside[positions], memory)
    _refuse_not_finite_estimate(friction_n, samples, estimator)
    return pd.DataFrame({FRICTION_COLUMN: friction_n, IN_RANGE_COLUMN: trusted}, index=rows.index)


def _checked_samples(rows: pd.DataFrame) -> NDArray[np.float64]:
    if len(rows) == 0:
        raise ScoringError("got no row; expected at least one sample")
    got = [str(column) for column in rows.columns]
    for column in SAMPLE_COLUMNS:
        if got.count(column) != 1:
            what = "missing" if column not in got else "there more than once"
            raise ScoringError(f"column {column!r} is {what}; got {got}, expected {list(SAMPLE_COLUMNS)}")
        kind = rows[column].dtype.kind if isinstance(rows[column].dtype, np.dtype) else "?"
        if kind not in "fiu":
            raise ScoringError(f"column {column!r} holds {rows[column].dtype}, expected numbers in SI units")
    samples = np.ascontiguousarray(rows[list(SAMPLE_COLUMNS)].to_numpy(dtype=np.float64))
    bad = ~np.isfinite(samples)
    if bad.any():
        row, at = (int(index) for index in np.argwhere(bad)[0])
        raise ScoringError(
            f"{SAMPLE_COLUMNS[at]} is {samples[row, at]} at row {row} ({int(bad.sum())} such values in all); expected "
            "finite numbers; repair or cut these rows before asking"
        )
    return samples


def _checked_names(rows: pd.DataFrame) -> Any:
    """Return what tells recordings apart, one value a row; zeros where all rows are one recording."""
    if RECORDING_COLUMN not in rows.columns:
        return np.zeros(len(rows), dtype=np.int64)
    names = rows[RECORDING_COLUMN].tolist()
    for row, name in enumerate(names):
        if not isinstance(name, str | int) or isinstance(name, bool) or name == "":
            raise ScoringError(
                f"{RECORDING_COLUMN} is {name!r} at row {row}; expected the name of a recording in every row, or no "
                "such column when all rows are one recording"
            )
    return np.array([str(name) for name in names])


def _no_doubt_within(inside: NDArray[np.bool_], memory: int) -> NDArray[np.bool_]:
    """Return where this row and the ``memory - 1`` rows before it are all inside."""
    outside_so_far = np.concatenate([[0], np.cumsum(~inside)])
    ends = np.arange(1, len(inside) + 1)
    return np.asarray(outside_so_far[ends] == outside_so_far[np.maximum(0, ends - memory)])


def _refuse_not_finite_estimate(
    friction_n: NDArray[np.float64], samples: NDArray[np.float64], estimator: FrictionEstimator
) -> None:
    bad = np.flatnonzero(~np.isfinite(friction_n))
    if len(bad):
        limits = estimator.training_range
        assert limits is not None
        raise ScoringError(
            f"no finite friction follows from row {bad[0]}: {dict(zip(SAMPLE_COLUMNS, samples[bad[0]], strict=True))}; "
            f"the estimator was trained between {list(limits.lower)} and {list(limits.upper)} (Pa, Pa, m); check units"
        )
