"""The served model's core: columns of raw samples in, columns of estimates out, and clear refusals.

This file needs NumPy and ONNX Runtime, and nothing of this project: it goes into the logged model beside the graph.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime
from numpy.typing import NDArray

NEWTONS = ("friction_n", "lower_n", "upper_n")
OFFSET = ("offset_n", "offset_uncertainty_n")
RECORDING_COLUMN = "recording"
LOAD_COLUMN = "load_force_n"
MEMORY_S = 1.0
"""How long a sample outside the training range makes those after it doubtful: filters and network remember it."""

Column = NDArray[Any] | Sequence[Any]


class ScoringError(ValueError):
    """Rows that cannot be scored; the message states which, what was found and expected, and what to do."""


class ServedGraph:
    """A sequence graph, which estimates whole recordings from a fresh state, and what its metadata state.

    Attributes:
        inputs: Columns of a sample, in order.
        outputs: Names of the numbers it gives for each row: newtons, then what it learns of the sensors' offset.
        memory: Rows for which a sample outside the training range counts.
        lower, upper: Training range of each input, widened by 5 %.
        flags: Names of the flags by their bits.
        position_load: The load that position decides, in words; empty where the model knows none.
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
        self.memory = max(1, round(MEMORY_S / float(stated["sample_time_s"])))
        self.flags = {int(bit): str(name) for bit, name in json.loads(stated["flags"]).items()}
        self.position_load = stated.get("position_load", "")
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
            names, each of its values is a sequence of its own, in row order, and rows of different recordings may
            alternate; without it all rows are one.

    Returns:
        ``friction_n``: friction [N], positive when it opposes positive velocity; ``lower_n``, ``upper_n``: bounds
        around it [N]; ``flags``: bits of ``Flag``, and ``flag_names``: their names, with spaces between them; each
        recording begins with a fresh state. ``in_training_range``:
        whether this row and all rows of its recording in the second before it lie within the training range widened
        by 5 %; if not, the friction is an extrapolation. Of an estimator that learns the offset of the sensors' zeros
        also ``offset_n`` and ``offset_uncertainty_n``: offset in friction as learned up to this row, which the next
        one's friction is free of, and its standard uncertainty [N]. All have shape ``(n,)``.

    Raises:
        ScoringError: There is no row, a column is missing, of another length or not numeric, a value is NaN or
            infinite, or a recording has no name; or a load is given that the model does not take.
    """
    _refuse_unused_load(graph, columns)
    samples = _checked_samples(columns, graph.inputs)
    numbers, flags = np.empty((len(samples), len(graph.outputs))), np.empty(len(samples), dtype=np.int64)
    inside, in_range = ((samples >= graph.lower) & (samples <= graph.upper)).all(axis=1), np.empty(len(samples), bool)
    for places in _places_by_recording(columns, len(samples)):
        numbers[places], flags[places] = graph.run(np.ascontiguousarray(samples[places]))
        in_range[places] = _all_within(inside[places], graph.memory)
    different, which = np.unique(flags, return_inverse=True)
    names = np.array([graph.names_of(value) for value in different.tolist()], dtype=object)
    newtons = dict(zip(graph.outputs[:3], numbers.T, strict=False))
    learned = dict(zip(graph.outputs[3:], numbers.T[3:], strict=True))
    return {**newtons, "flags": flags, "flag_names": names[which], "in_training_range": in_range, **learned}


def _refuse_unused_load(graph: ServedGraph, columns: Mapping[str, Column]) -> None:
    if LOAD_COLUMN in columns and LOAD_COLUMN not in graph.inputs:
        load = graph.position_load
        why = f"knows: {load}" if load else "was trained without one and would take it for friction"
        left_out = "that is the load on the rod" if load else "nothing is on the rod"
        raise ScoringError(
            f"column {LOAD_COLUMN!r} is given, but this model {why}; expected {list(graph.inputs)}; serve a model that "
            f"has the load among its inputs, or leave the column out if {left_out}"
        )


def _checked_samples(columns: Mapping[str, Column], inputs: tuple[str, ...]) -> NDArray[np.float64]:
    """Return the inputs side by side, shape ``(n, inputs)``."""
    for name in inputs:
        if name not in columns:
            raise ScoringError(f"column {name!r} is missing; got {_names(columns)}, expected {list(inputs)}")
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
        row, value = next((at, each) for at, each in enumerate(values) if type(each) not in (float, int))
        raise ScoringError(
            f"column {name!r} holds {_shown(value)} at row {row}, expected numbers in SI units; send each value as a "
            "number, not as text, and leave out rows without one"
        )
    try:
        return np.array(values, dtype=np.float64)
    except OverflowError as error:
        raise ScoringError(f"column {name!r} holds a whole number beyond all float, expected SI units") from error


def _places_by_recording(columns: Mapping[str, Column], count: int) -> list[NDArray[np.intp]]:
    """Return the places of each recording's rows; all rows are one where no recording is named."""
    if RECORDING_COLUMN not in columns:
        return [np.arange(count)]
    names = columns[RECORDING_COLUMN]
    by_name: dict[str, list[int]] = {}
    for row, name in enumerate(names.tolist() if isinstance(names, np.ndarray) else names):
        if not isinstance(name, str | int) or isinstance(name, bool) or name == "":
            raise ScoringError(
                f"{RECORDING_COLUMN} is {_shown(name)} at row {row}; expected the name of a recording in every row, or "
                "no such column when all rows are one recording"
            )
        by_name.setdefault(str(name), []).append(row)
    return [np.array(places) for places in by_name.values()]


def _all_within(inside: NDArray[np.bool_], memory: int) -> NDArray[np.bool_]:
    """Return where this row and the ``memory - 1`` rows before it are all inside."""
    outside_so_far = np.concatenate([[0], np.cumsum(~inside)])
    ends = np.arange(1, len(inside) + 1)
    return np.asarray(outside_so_far[ends] == outside_so_far[np.maximum(0, ends - memory)])


def _names(columns: Mapping[str, Column]) -> str:
    return _shown([str(name) for name in columns], 400)


def _shown(value: object, length: int = 80) -> str:
    """Return a value as Python writes it, but not at any length."""
    text = repr(value)
    return text if len(text) <= length else f"{text[:length]}..."
