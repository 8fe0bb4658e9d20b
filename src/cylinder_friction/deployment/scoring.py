"""What the served model does with a table of raw samples: one estimate per row, and clear refusals."""

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cylinder_friction.realtime.flags import Flag
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.realtime.stream import RealTimeStream
from cylinder_friction.recordings.columns import LOAD_FORCE

NEWTONS = ("friction_n", "lower_n", "upper_n")
OFFSET = ("offset_n", "offset_uncertainty_n")
RECORDING_COLUMN = "recording"
MEMORY_S = 1.0
"""How long a sample outside the training range makes those after it doubtful: filters and network remember it."""


class ScoringError(ValueError):
    """Rows that cannot be scored; the message states which, what was found and expected, and what to do."""


def score(model: StepModel, rows: pd.DataFrame) -> pd.DataFrame:
    """Return one row for each row given, in their order: what every other runtime gives, and two columns more.

    Args:
        model: The step of a fitted estimator.
        rows: Raw samples at the model's sample time, in the columns ``model.inputs``. With a column ``recording`` each
            of its values is a sequence of its own, in row order, and rows of different recordings may alternate;
            without it all rows are one.

    Returns:
        ``friction_n``: friction [N], positive when it opposes positive velocity; ``lower_n``, ``upper_n``: bounds
        around it [N]; ``flags``: bits of ``Flag``, and ``flag_names``: their names, with spaces between them; each
        recording begins with a fresh state. ``in_training_range``:
        whether this row and all rows of its recording in the second before it lie within the training range widened
        by 5 %; if not, the friction is an extrapolation. Of an estimator that learns the offset of the sensors' zeros
        also ``offset_n`` and ``offset_uncertainty_n``: offset in friction as learned up to this row, which the next
        one's friction is free of, and its standard uncertainty [N].

    Raises:
        ScoringError: There is no row, a column is missing or not numeric, a value is NaN or infinite, or a recording
            has no name; or a load is given that the model does not take.
    """
    _refuse_unused_load(rows, model)
    samples = _checked_samples(rows, model.inputs)
    names = _checked_names(rows)
    memory = max(1, round(MEMORY_S / model.sample_time_s))
    lower, upper = np.array(model.guard.trained_lower), np.array(model.guard.trained_upper)
    inside = np.asarray(((samples >= lower) & (samples <= upper)).all(axis=1))
    newtons, offsets = np.empty((len(samples), 3)), np.empty((len(samples), 2))
    flags, in_range = np.empty(len(samples), dtype=np.int64), np.empty(len(samples), dtype=np.bool_)
    stream = RealTimeStream(model)
    for positions in pd.Series(range(len(samples))).groupby(names, sort=False).indices.values():
        stream.reset()
        newtons[positions], offsets[positions], flags[positions] = stream.run_with_offset(samples[positions])
        in_range[positions] = _all_within(inside[positions], memory)
    names_of = {value: " ".join(Flag.names(value)) for value in set(flags.tolist())}
    result = pd.DataFrame(newtons, rows.index, NEWTONS)
    result = result.assign(flags=flags, flag_names=[names_of[value] for value in flags.tolist()])
    result = result.assign(in_training_range=in_range)
    return result if model.offset is None else result.assign(**dict(zip(OFFSET, offsets.T, strict=True)))


def _refuse_unused_load(rows: pd.DataFrame, model: StepModel) -> None:
    if LOAD_FORCE in rows.columns and LOAD_FORCE not in model.inputs and rows[LOAD_FORCE].notna().any():
        load = model.position_load
        why = "was trained without one and would take it for friction" if load is None else f"knows: {load.in_words()}"
        left_out = "nothing is on the rod" if load is None else "that is the load on the rod"
        raise ScoringError(
            f"column {LOAD_FORCE!r} is given, but this model {why}; expected {list(model.inputs)}; serve a model that "
            f"has the load among its inputs, or leave the column out if {left_out}"
        )


def _checked_samples(rows: pd.DataFrame, inputs: tuple[str, ...]) -> NDArray[np.float64]:
    if len(rows) == 0:
        raise ScoringError("got no row; expected at least one sample")
    got = [str(column) for column in rows.columns]
    for column in inputs:
        if got.count(column) != 1:
            what = "missing" if column not in got else "there more than once"
            raise ScoringError(f"column {column!r} is {what}; got {got}, expected {list(inputs)}")
        kind = rows[column].dtype.kind if isinstance(rows[column].dtype, np.dtype) else "?"
        if kind not in "fiu":
            raise ScoringError(f"column {column!r} holds {rows[column].dtype}, expected numbers in SI units")
    samples = np.ascontiguousarray(rows[list(inputs)].to_numpy(dtype=np.float64))
    bad = ~np.isfinite(samples)
    if bad.any():
        row, at = (int(index) for index in np.argwhere(bad)[0])
        raise ScoringError(
            f"{inputs[at]} is {samples[row, at]} at row {row} ({int(bad.sum())} such values in all); expected "
            "finite numbers; repair or remove these rows before sending"
        )
    return samples


def _checked_names(rows: pd.DataFrame) -> Any:
    """Return each row's recording; zeros where all rows are one recording."""
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


def _all_within(inside: NDArray[np.bool_], memory: int) -> NDArray[np.bool_]:
    """Return where this row and the ``memory - 1`` rows before it are all inside."""
    outside_so_far = np.concatenate([[0], np.cumsum(~inside)])
    ends = np.arange(1, len(inside) + 1)
    return np.asarray(outside_so_far[ends] == outside_so_far[np.maximum(0, ends - memory)])
