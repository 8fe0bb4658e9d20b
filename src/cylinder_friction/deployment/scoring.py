"""The core of the served model: from columns of raw samples to columns of estimates, with clear refusals."""

import itertools
import threading
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from cylinder_friction.realtime.flags import Flag
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.realtime.stream import CompiledRun
from cylinder_friction.recordings.columns import LOAD_FORCE, POSITION

NEWTONS = ("friction_n", "lower_n", "upper_n")
OFFSET = ("offset_n", "offset_uncertainty_n")
RECORDING_COLUMN = "recording"
TIME_COLUMN = "time_s"
MAX_ROWS = 200_000
"""Most rows of one request. A proxy can limit the bytes."""
SHOWN = 80
"""Most characters of a value in a message."""
MEMORY_S = 1.0
"""Time for which a sample outside the training range makes estimates doubtful, as filters and network remember it."""

TIME_JITTER = 0.5
"""Share of the sample time by which one step of ``time_s`` may differ from it."""
RATE_TOLERANCE = 0.02
"""Share of the sample time by which the mean step of ``time_s`` may differ from it."""
JUMP_SHARE, JUMP_RATIO, JUMP_ROWS = 0.01, 5.0, 3
"""Another recording begins at a step of the position above this share of its range that is this many times as long as
each of this many steps before and after. A sensor's spike makes two such steps, and a start of motion makes many."""

Column = NDArray[Any] | Sequence[Any]


class ScoringError(ValueError):
    """Rows cannot be scored; the message states which rows, what was found and expected, and what to do."""


class ServedModel:
    """An estimator's guarded step, run over whole recordings, each from a fresh state.

    Requests of several threads may share one: each recording runs alone.

    Attributes:
        model: The estimator's step.
        inputs: Columns of a sample, in order.
        outputs: Names of the numbers for each row: newtons, then the learned offset of the sensors.
        memory: Rows after a sample outside the training range that count as outside too.
        lower, upper: Training range of each input's readings, widened by 5 %.
    """

    def __init__(self, model: StepModel) -> None:
        self.model, self.inputs = model, model.inputs
        self.outputs = NEWTONS if model.offset is None else (*NEWTONS, *OFFSET)
        self.memory = max(1, round(MEMORY_S / model.sample_time_s))
        self.lower, self.upper = model.trained_readings
        self._step, self._one_at_a_time = CompiledRun(model), threading.Lock()

    def run(self, samples: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Compute ``outputs``, shape ``(n, outputs)``, and flags, ``(n,)``, of samples, ``(n, inputs)``."""
        with self._one_at_a_time:
            self._step.reset()
            newtons, offset, flags = self._step.run_with_offset(samples)
        return np.concatenate([newtons, offset], axis=1)[:, : len(self.outputs)], flags


def score_frame(served: ServedModel, rows: Any) -> pd.DataFrame:
    """Score a table as MLflow passes it on: a data frame with row numbers as its index.

    Raises:
        ScoringError: See ``score_columns``; or the rows have no named columns, or an index with a meaning.

    """
    scored = score_columns(served, _columns(rows))
    texts = pd.Series(scored["flag_names"], rows.index, dtype=object)  # not copied into Arrow's text, and back
    return pd.DataFrame({**scored, "flag_names": texts}, rows.index, copy=False)


def _columns(rows: Any) -> dict[str, Column]:
    if not isinstance(rows, pd.DataFrame):
        raise ScoringError("got no rows with named columns; expected a list of values for each column")
    index = rows.index
    if not (index.step == 1 if isinstance(index, pd.RangeIndex) else list(index) == list(range(len(index)))):
        raise ScoringError(
            f"the index, {index.name or 'without a name'}, begins with {index[:2].tolist()!r:.80}; expected row "
            "numbers from 0 without gaps: a CSV has more values than its header, recordings were put together, or "
            "rows were left out; send what it holds as a column, or leave it out where rows are whole recordings"
        )
    return {str(name): values.to_numpy() for name, values in rows.items()}


def score_columns(served: ServedModel, columns: Mapping[str, Column]) -> dict[str, NDArray[Any]]:
    """Score rows as every other runtime does, and add two columns; the result is in the rows' order.

    Args:
        served: The model in service.
        columns: Readings of the sensors at the model's sample time, ``served.inputs``, each of shape ``(n,)``. With
            ``recording``, names, each name is a sequence of its own, whose rows follow each other; without it all rows
            are one. With ``time_s`` [s], the rows' times, they are checked; nothing else uses them. Other columns are
            ignored.

    Returns:
        ``friction_n``: friction [N], positive when it opposes positive velocity; ``lower_n``, ``upper_n``: bounds
        around it [N]; ``flags``: bits of ``Flag``, and ``flag_names``: their names, with spaces between them; each
        recording begins with a fresh state. A row flagged ``NOT_READY`` has no estimate: its friction and bounds are
        None (0 in the other runtimes). ``in_training_range``: whether this row and all rows of its recording in the
        second before it lie within the training range widened by 5 %; if not, the friction is an extrapolation. Of an
        estimator that learns the offset of the sensors' zeros also ``offset_n`` and ``offset_uncertainty_n``: offset in
        friction as learned up to this row, which the next one's friction is free of, and its standard uncertainty [N].
        All have shape ``(n,)``.

    Raises:
        ScoringError: There is no row, a column is missing, of another length or not numeric, or a value is NaN or
            infinite; a recording has no name, or comes back after another; rows that are one recording are
            evidently several, by their times or their positions; or a load is given that the model does not take.
    """
    _refuse_other_columns(served, columns)
    samples = _checked_samples(columns, served.inputs)
    recordings = _recordings(columns, len(samples))
    for rows in recordings:
        _refuse_several(served, columns, samples, rows)
    numbers, flags = np.empty((len(samples), len(served.outputs))), np.empty(len(samples), dtype=np.int64)
    inside = np.all((samples >= served.lower) & (samples <= served.upper), axis=1)
    in_range = np.empty(len(samples), dtype=np.bool_)
    for rows in recordings:
        numbers[rows], flags[rows] = served.run(samples[rows])
        in_range[rows] = _all_within(inside[rows], served.memory)
    different, which = np.unique(flags, return_inverse=True)
    names = np.array([" ".join(Flag.names(value)) for value in different.tolist()], dtype=object)
    newtons: dict[str, Any] = dict(zip(served.outputs[:3], numbers.T, strict=False))
    not_ready = flags & Flag.NOT_READY != 0
    if not_ready.any():  # 0 would look like a certain estimate, and NaN is no JSON
        newtons = {name: np.where(not_ready, None, values) for name, values in newtons.items()}
    learned = dict(zip(served.outputs[3:], numbers.T[3:], strict=True))
    return {**newtons, "flags": flags, "flag_names": names[which], "in_training_range": in_range, **learned}


def _refuse_other_columns(served: ServedModel, columns: Mapping[str, Column]) -> None:
    """Refuse a load that the model would ignore, and columns without an input."""
    if LOAD_FORCE in columns and LOAD_FORCE not in served.inputs:
        load = served.model.position_load
        why = f"knows: {load.in_words()}" if load else "was trained without one and would take it for friction"
        left_out = "that is the load on the rod" if load else "nothing is on the rod"
        raise ScoringError(
            f"column {LOAD_FORCE!r} is given, but this model {why}; expected {list(served.inputs)}; serve a model that "
            f"has the load among its inputs, or leave the column out if {left_out}"
        )
    if missing := [name for name in served.inputs if name not in columns]:
        raise ScoringError(
            f"column {missing[0]!r} is missing; got {shortened([*columns], 400)}, expected {list(served.inputs)}"
        )


def _checked_samples(columns: Mapping[str, Column], inputs: tuple[str, ...]) -> NDArray[np.float64]:
    """Stack the inputs side by side, shape ``(n, inputs)``."""
    lengths = {name: len(columns[name]) for name in columns}
    if len(set(lengths.values())) > 1:
        raise ScoringError(f"columns have {lengths} values; expected equally many in each")
    samples = np.stack([_numbers(name, columns[name]) for name in inputs], axis=1)
    if len(samples) == 0:
        raise ScoringError("got no row; expected at least one sample")
    if len(samples) > MAX_ROWS:
        raise ScoringError(f"got {len(samples)} rows; expected at most {MAX_ROWS}; send the recordings one by one")
    bad = ~np.isfinite(samples)
    if bad.any():
        row, at = (int(index) for index in np.argwhere(bad)[0])
        raise ScoringError(
            f"{inputs[at]} is {samples[row, at]} at row {row} ({int(bad.sum())} in all); expected "
            "finite numbers; repair or remove these rows before sending"
        )
    return samples


def _numbers(name: str, values: Column) -> NDArray[np.float64]:
    """Read a column's numbers; booleans and text are refused, whatever they could be read as."""
    if isinstance(values, np.ndarray) and values.dtype != object:
        if values.dtype.kind not in "fiu" or values.ndim != 1:
            raise ScoringError(f"column {name!r} holds {values.dtype}, expected numbers in SI units")
        return values.astype(np.float64, copy=False)
    values = values.tolist() if isinstance(values, np.ndarray) else values
    if not {type(value) for value in values} <= {float, int}:
        row = next(at for at, value in enumerate(values) if type(value) not in (float, int))
        row = values.index(name) if name in values else row  # or a CSV's numbers, which are text beside it, are named
        value, what = values[row], "each value must be a number, not text"
        what = "the header again; remove it" if value == name else what
        raise ScoringError(
            f"column {name!r} holds {shortened(value)} at row {row}, expected numbers in SI units; {what}"
        )
    try:
        return np.array(values, dtype=np.float64)
    except OverflowError as error:
        raise ScoringError(f"column {name!r} holds a whole number beyond all float, expected SI units") from error


def _recordings(columns: Mapping[str, Column], count: int) -> list[slice]:
    """List the rows of each recording; all rows are one if no recording is named."""
    if RECORDING_COLUMN not in columns:
        return [slice(0, count)]
    given = columns[RECORDING_COLUMN]
    names = given.tolist() if isinstance(given, np.ndarray) else list(given)
    for row, name in enumerate(names):
        if type(name) not in (str, int) or name == "" or type(name) is not type(names[0]):
            raise ScoringError(
                f"{RECORDING_COLUMN} is {shortened(name)} at row {row}; expected the name of a recording in every row, "
                "all text or all whole numbers, or no such column when all rows are one recording"
            )
    rows: list[slice] = []
    seen = set()
    for name, same in itertools.groupby(names):
        begin = rows[-1].stop if rows else 0
        if name in seen:
            raise ScoringError(
                f"{RECORDING_COLUMN} {shortened(name)} comes back at row {begin}; expected the rows of a recording to "
                "follow each other; put them together in the order of time, or name two recordings differently"
            )
        seen.add(name)
        rows.append(slice(begin, begin + sum(1 for _ in same)))
    return rows


def _refuse_several(
    served: ServedModel, columns: Mapping[str, Column], samples: NDArray[np.float64], rows: slice
) -> None:
    """Refuse rows that are taken for one recording and evidently are several, or have another sample time."""
    advice = f"name each recording in {RECORDING_COLUMN!r}, or send it by itself"
    if TIME_COLUMN in columns:
        steps_s = np.diff(_numbers(TIME_COLUMN, columns[TIME_COLUMN])[rows])
        expected_s = served.model.sample_time_s
        wrong = ~(np.abs(steps_s - expected_s) <= TIME_JITTER * expected_s)
        if wrong.any():
            at = int(wrong.argmax())
            raise ScoringError(
                f"{TIME_COLUMN} goes on by {steps_s[at]:g} s at row {rows.start + at + 1}, expected {expected_s:g} s "
                f"from row to row; where another recording begins, {advice}; resample one that was taken otherwise"
            )
        if len(steps_s) and abs(mean_s := float(steps_s.mean()) - expected_s) > RATE_TOLERANCE * expected_s:
            raise ScoringError(
                f"{TIME_COLUMN} goes on by {mean_s + expected_s:g} s on average, expected {expected_s:g} s from row to "
                "row; resample the recording"
            )
    if POSITION in served.inputs:
        place = served.inputs.index(POSITION)
        row = _jump(samples[rows, place], float(served.lower[place]), float(served.upper[place]))
        if row is not None:
            before, after = samples[rows.start + row - 1 : rows.start + row + 1, place]
            raise ScoringError(
                f"{POSITION} jumps from {before:g} to {after:g} at row {rows.start + row}, which no piston "
                f"does: another recording begins there; {advice}"
            )


def _jump(position_m: NDArray[np.float64], lower: float, upper: float) -> int | None:
    """Find the first row whose position no motion leads to; see ``JUMP_SHARE``. Invalid positions do not count."""
    within = (position_m >= lower) & (position_m <= upper)
    steps = np.abs(np.diff(np.where(within, position_m, 0.0)))
    for at in np.flatnonzero((steps > JUMP_SHARE * (upper - lower)) & within[1:] & within[:-1]).tolist():
        around = np.concatenate([steps[max(0, at - JUMP_ROWS) : at], steps[at + 1 : at + 1 + JUMP_ROWS]])
        if len(around) and steps[at] > JUMP_RATIO * around.max():
            return int(at) + 1
    return None


def _all_within(inside: NDArray[np.bool_], memory: int) -> NDArray[np.bool_]:
    """Mark the rows that are inside together with the ``memory - 1`` rows before them."""
    outside_so_far = np.concatenate([[0], np.cumsum(~inside)])
    ends = np.arange(1, len(inside) + 1)
    return np.asarray(outside_so_far[ends] == outside_so_far[np.maximum(0, ends - memory)])


def shortened(value: object, length: int = SHOWN) -> str:
    """Write a value as Python does, shortened to ``SHOWN`` characters."""
    text = repr(value[: 2 * length] if isinstance(value, str | bytes) else value)
    return text if len(text) <= length else f"{text[:length]}..."
