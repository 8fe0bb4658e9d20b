"""The served model's core: columns of raw samples in, columns of estimates out, and clear refusals.

This file needs NumPy and ONNX Runtime, and nothing of this project: it goes into the logged model beside the graph.
"""

import difflib
import itertools
import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")  # read when it is imported
import onnxruntime

NEWTONS = ("friction_n", "lower_n", "upper_n")
OFFSET = ("offset_n", "offset_uncertainty_n")
RECORDING_COLUMN = "recording"
TIME_COLUMN = "time_s"
LOAD_COLUMN = "load_force_n"
POSITION_COLUMN = "position_m"
SHOWN = 80
MEMORY_S = 1.0
"""How long a sample outside the training range makes those after it doubtful: filters and network remember it."""

TIME_JITTER = 0.5
"""Share of the sample time by which one step of ``time_s`` may differ from it."""
RATE_TOLERANCE = 0.02
"""Share of the sample time by which the mean step of ``time_s`` may differ from it."""
JUMP_SHARE, JUMP_RATIO, JUMP_ROWS = 0.01, 5.0, 3
"""A step of the position over this share of its range, so many times as long as each of so many before and after, is
no motion: another recording begins. A sensor's spike makes two such steps, and motion that begins many."""

Column = NDArray[Any] | Sequence[Any]


class ScoringError(ValueError):
    """Rows that cannot be scored; the message states which, what was found and expected, and what to do."""


class ServedGraph:
    """A sequence graph, which estimates whole recordings from a fresh state, and what its metadata state.

    Attributes:
        inputs: Columns of a sample, in order.
        outputs: Names of the numbers it gives for each row: newtons, then what it learns of the sensors' offset.
        sample_time_s: Between two rows [s].
        memory: Rows for which a sample outside the training range counts.
        lower, upper: Training range of each input, widened by 5 %.
        flags: Names of the flags by their bits.
        position_load: The load that position decides, in words; empty where the model knows none.
        trained_for: Which cylinder it was trained for, in words; empty where that is not stated.
        bounds: What the bounds hold, in words.
    """

    def __init__(self, graph: Path | bytes) -> None:
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.enable_cpu_mem_arena = False  # it would keep what the longest recording has ever taken
        source = graph if isinstance(graph, bytes) else str(graph)
        self._session = onnxruntime.InferenceSession(source, options, providers=["CPUExecutionProvider"])
        stated = self._session.get_modelmeta().custom_metadata_map
        ranges = json.loads(stated["training_range_with_margin"])
        self.inputs = tuple(ranges)
        self.lower, self.upper = np.array(list(ranges.values()), dtype=np.float64).T
        self.sample_time_s = float(stated["sample_time_s"])
        self.memory = max(1, round(MEMORY_S / self.sample_time_s))
        self.flags = {int(bit): str(name) for bit, name in json.loads(stated["flags"]).items()}
        self.position_load, self.bounds = stated.get("position_load", ""), stated.get("bounds_hold", "not stated")
        self.trained_for = stated.get("trained_for", "")
        names = {port.name for port in self._session.get_outputs()}
        self.outputs = (*NEWTONS, *(name for name in OFFSET if name in names))
        self._given = {"offset": np.zeros((1, 2))} if len(self.outputs) > len(NEWTONS) else {}

    def run(self, samples: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
        """Return ``outputs`` of each row, shape ``(n, outputs)``, and flags, ``(n,)``; samples have ``(n, inputs)``."""
        try:
            *numbers, flags = self._session.run([*self.outputs, "flags"], {"samples": samples, **self._given})
        except Exception as error:  # ONNX Runtime has no class for it
            raise MemoryError(f"{len(samples)} rows") if "alloc" in str(error) else error from None
        return np.stack(numbers, axis=1), np.asarray(flags)

    def names_of(self, flags: int) -> str:
        """Return the names of the flags that are set, with spaces between them."""
        return " ".join(name for bit, name in self.flags.items() if bit & flags)


def score_columns(graph: ServedGraph, columns: Mapping[str, Column]) -> dict[str, NDArray[Any]]:
    """Return what every other runtime gives at each row, and two columns more, in the rows' order.

    Args:
        graph: Of a fitted estimator.
        columns: Raw samples at the model's sample time, ``graph.inputs``, each of shape ``(n,)``. With ``recording``,
            names, each name is a sequence of its own, whose rows follow each other; without it all rows are one. With
            ``time_s`` [s], the rows' times, they are checked; nothing else uses them. No other column is taken.

    Returns:
        ``friction_n``: friction [N], positive when it opposes positive velocity; ``lower_n``, ``upper_n``: bounds
        around it [N]; ``flags``: bits of ``Flag``, and ``flag_names``: their names, with spaces between them; each
        recording begins with a fresh state. ``in_training_range``:
        whether this row and all rows of its recording in the second before it lie within the training range widened
        by 5 %; if not, the friction is an extrapolation. Of an estimator that learns the offset of the sensors' zeros
        also ``offset_n`` and ``offset_uncertainty_n``: offset in friction as learned up to this row, which the next
        one's friction is free of, and its standard uncertainty [N]. All have shape ``(n,)``.

    Raises:
        ScoringError: There is no row, a column is missing, unknown, of another length or not numeric, or a value is NaN
            or infinite; a recording has no name, or comes back after another; rows that are one recording are
            evidently several, by their times or their positions; or a load is given that the model does not take.
    """
    _refuse_unknown(graph, columns)
    samples = _checked_samples(columns, graph.inputs)
    recordings = _recordings(columns, len(samples))
    for rows in recordings:
        _refuse_several(graph, columns, samples, rows)
    numbers, flags = np.empty((len(samples), len(graph.outputs))), np.empty(len(samples), dtype=np.int64)
    inside, in_range = ((samples >= graph.lower) & (samples <= graph.upper)).all(axis=1), np.empty(len(samples), bool)
    for rows in recordings:
        numbers[rows], flags[rows] = graph.run(samples[rows])
        in_range[rows] = _all_within(inside[rows], graph.memory)
    different, which = np.unique(flags, return_inverse=True)
    names = np.array([graph.names_of(value) for value in different.tolist()], dtype=object)
    newtons = dict(zip(graph.outputs[:3], numbers.T, strict=False))
    learned = dict(zip(graph.outputs[3:], numbers.T[3:], strict=True))
    return {**newtons, "flags": flags, "flag_names": names[which], "in_training_range": in_range, **learned}


def _refuse_unknown(graph: ServedGraph, columns: Mapping[str, Column]) -> None:
    """Refuse columns that change nothing: each may be one that was meant to."""
    if LOAD_COLUMN in columns and LOAD_COLUMN not in graph.inputs:
        load = graph.position_load
        why = f"knows: {load}" if load else "was trained without one and would take it for friction"
        left_out = "that is the load on the rod" if load else "nothing is on the rod"
        raise ScoringError(
            f"column {LOAD_COLUMN!r} is given, but this model {why}; expected {list(graph.inputs)}; serve a model that "
            f"has the load among its inputs, or leave the column out if {left_out}"
        )
    known = [*graph.inputs, RECORDING_COLUMN, TIME_COLUMN]
    if missing := [name for name in graph.inputs if name not in columns]:
        raise ScoringError(f"column {missing[0]!r} is missing; got {_names(columns)}, expected {list(graph.inputs)}")
    if unknown := [name for name in columns if name not in known]:
        close = difflib.get_close_matches(unknown[0][:100], known, 1)
        raise ScoringError(
            f"column {shown(unknown[0])} is not known{f' (is it {close[0]!r}?)' if close else ''}; got "
            f"{_names(columns)}, expected {list(graph.inputs)} and perhaps {known[-2:]}; rename it or leave it out"
        )


def _checked_samples(columns: Mapping[str, Column], inputs: tuple[str, ...]) -> NDArray[np.float64]:
    """Return the inputs side by side, shape ``(n, inputs)``."""
    lengths = {name: len(columns[name]) for name in columns}
    if len(set(lengths.values())) > 1:
        raise ScoringError(f"columns have {lengths} values; expected equally many in each")
    samples = np.stack([_numbers(name, columns[name]) for name in inputs], axis=1)
    if len(samples) == 0:
        raise ScoringError("got no row; expected at least one sample")
    bad = ~np.isfinite(samples)
    if bad.any():
        row, at = (int(index) for index in np.argwhere(bad)[0])
        raise ScoringError(
            f"{inputs[at]} is {samples[row, at]} at row {row} ({int(bad.sum())} such values in all); expected "
            "finite numbers; repair or remove these rows before sending"
        )
    return samples


def _numbers(name: str, values: Column) -> NDArray[np.float64]:
    """Return a column's numbers; booleans and text are none, whatever they could be read as."""
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
        raise ScoringError(f"column {name!r} holds {shown(value)} at row {row}, expected numbers in SI units; {what}")
    try:
        return np.array(values, dtype=np.float64)
    except OverflowError as error:
        raise ScoringError(f"column {name!r} holds a whole number beyond all float, expected SI units") from error


def _recordings(columns: Mapping[str, Column], count: int) -> list[slice]:
    """Return the rows of each recording; all rows are one where no recording is named."""
    if RECORDING_COLUMN not in columns:
        return [slice(0, count)]
    given = columns[RECORDING_COLUMN]
    names = given.tolist() if isinstance(given, np.ndarray) else list(given)
    for row, name in enumerate(names):
        if type(name) not in (str, int) or name == "" or type(name) is not type(names[0]):
            raise ScoringError(
                f"{RECORDING_COLUMN} is {shown(name)} at row {row}; expected the name of a recording in every row, "
                "all text or all whole numbers, or no such column when all rows are one recording"
            )
    rows: list[slice] = []
    seen = set()
    for name, same in itertools.groupby(names):
        begin = rows[-1].stop if rows else 0
        if name in seen:
            raise ScoringError(
                f"{RECORDING_COLUMN} {shown(name)} comes back at row {begin}; expected the rows of a recording to "
                "follow each other; put them together in the order of time, or name two recordings differently"
            )
        seen.add(name)
        rows.append(slice(begin, begin + sum(1 for _ in same)))
    return rows


def _refuse_several(
    graph: ServedGraph, columns: Mapping[str, Column], samples: NDArray[np.float64], rows: slice
) -> None:
    """Refuse rows that are taken for one recording and evidently are several, or have another sample time."""
    advice = f"name each recording in {RECORDING_COLUMN!r}, or send it by itself"
    if TIME_COLUMN in columns:
        steps_s = np.diff(_numbers(TIME_COLUMN, columns[TIME_COLUMN])[rows])
        expected_s = graph.sample_time_s
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
    if POSITION_COLUMN in graph.inputs:
        place = graph.inputs.index(POSITION_COLUMN)
        row = _jump(samples[rows, place], float(graph.lower[place]), float(graph.upper[place]))
        if row is not None:
            before, after = samples[rows.start + row - 1 : rows.start + row + 1, place]
            raise ScoringError(
                f"{POSITION_COLUMN} jumps from {before:g} to {after:g} at row {rows.start + row}, which no piston "
                f"does: another recording begins there; {advice}"
            )


def _jump(position_m: NDArray[np.float64], lower: float, upper: float) -> int | None:
    """Return the first row whose position no motion leads to; see ``JUMP_SHARE``. Invalid positions do not count."""
    within = (position_m >= lower) & (position_m <= upper)
    steps = np.abs(np.diff(np.where(within, position_m, 0.0)))
    for at in np.flatnonzero((steps > JUMP_SHARE * (upper - lower)) & within[1:] & within[:-1]).tolist():
        around = np.concatenate([steps[max(0, at - JUMP_ROWS) : at], steps[at + 1 : at + 1 + JUMP_ROWS]])
        if len(around) and steps[at] > JUMP_RATIO * around.max():
            return int(at) + 1
    return None


def _all_within(inside: NDArray[np.bool_], memory: int) -> NDArray[np.bool_]:
    """Return where this row and the ``memory - 1`` rows before it are all inside."""
    outside_so_far = np.concatenate([[0], np.cumsum(~inside)])
    ends = np.arange(1, len(inside) + 1)
    return np.asarray(outside_so_far[ends] == outside_so_far[np.maximum(0, ends - memory)])


def _names(columns: Mapping[str, Column]) -> str:
    return shown([str(name) for name in columns], 400)


def shown(value: object, length: int = SHOWN) -> str:
    """Return a value as Python writes it, but not at any length."""
    text = repr(value[: 2 * length] if isinstance(value, str | bytes) else value)
    return text if len(text) <= length else f"{text[:length]}..."
