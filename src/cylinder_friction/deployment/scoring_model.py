"""The served model: one estimate per row of raw samples, and clear refusals.

This one file goes into the logged model beside the estimator's graph, and runs it with NumPy, pandas, ONNX Runtime and
MLflow alone: nothing else of this project is needed where it is served. Nothing is pickled.
"""

import json
from pathlib import Path
from typing import Any

import mlflow
import numpy as np
import onnxruntime
import pandas as pd  # MLflow reads predict's type hints at run time
from mlflow.exceptions import MlflowException
from mlflow.protos.databricks_pb2 import INVALID_PARAMETER_VALUE
from mlflow.pyfunc.model import PythonModel
from numpy.typing import NDArray

NEWTONS = ["friction_n", "lower_n", "upper_n"]
OFFSET = ["offset_n", "offset_uncertainty_n"]
RECORDING_COLUMN = "recording"
LOAD_COLUMN = "load_force_n"
MEMORY_S = 1.0
"""How long a sample outside the training range makes those after it doubtful: filters and network remember it."""


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
        self.outputs = [*NEWTONS, *(name for name in OFFSET if name in names)]
        self._given = {"offset": np.zeros((1, 2))} if len(self.outputs) > len(NEWTONS) else {}

    def run(self, samples: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
        """Return ``outputs`` of each row, shape ``(n, outputs)``, and flags, ``(n,)``; samples have ``(n, inputs)``."""
        *numbers, flags = self._session.run([*self.outputs, "flags"], {"samples": samples, **self._given})
        return np.stack(numbers, axis=1), np.asarray(flags)

    def names_of(self, flags: int) -> str:
        """Return the names of the flags that are set, with spaces between them."""
        return " ".join(name for bit, name in self.flags.items() if bit & flags)


class FrictionScoringModel(PythonModel):
    """Friction from rows of raw samples; see ``score``."""

    def load_context(self, context: Any) -> None:
        """Open the model's artifact ``graph``."""
        self._graph = ServedGraph(Path(context.artifacts["graph"]))

    def predict(self, context: Any, model_input: pd.DataFrame, params: Any = None) -> pd.DataFrame:  # noqa: ARG002
        """Return what ``score`` does, one row for each row given; rows that cannot be scored give 400."""
        try:
            return score(self._graph, model_input)
        except ScoringError as error:
            raise MlflowException(str(error), error_code=INVALID_PARAMETER_VALUE) from error


def score(graph: ServedGraph, rows: pd.DataFrame) -> pd.DataFrame:
    """Return one row for each row given, in their order: what every other runtime gives, and two columns more.

    Args:
        graph: Of a fitted estimator.
        rows: Raw samples at the model's sample time, in the columns ``graph.inputs``. With a column ``recording`` each
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
    _refuse_unused_load(graph, rows)
    samples = _checked_samples(rows, graph.inputs)
    numbers, flags = np.empty((len(samples), len(graph.outputs))), np.empty(len(samples), dtype=np.int64)
    inside, in_range = ((samples >= graph.lower) & (samples <= graph.upper)).all(axis=1), np.empty(len(samples), bool)
    for places in _places_by_recording(rows):
        numbers[places], flags[places] = graph.run(np.ascontiguousarray(samples[places]))
        in_range[places] = _all_within(inside[places], graph.memory)
    names_of = {value: graph.names_of(value) for value in set(flags.tolist())}
    result = pd.DataFrame(numbers[:, : len(NEWTONS)], rows.index, NEWTONS)
    result = result.assign(flags=flags, flag_names=[names_of[value] for value in flags.tolist()])
    learned = dict(zip(OFFSET, numbers[:, len(NEWTONS) :].T, strict=False))
    return result.assign(in_training_range=in_range, **learned)


def _refuse_unused_load(graph: ServedGraph, rows: pd.DataFrame) -> None:
    if LOAD_COLUMN in rows.columns and LOAD_COLUMN not in graph.inputs and rows[LOAD_COLUMN].notna().any():
        load = graph.position_load
        why = f"knows: {load}" if load else "was trained without one and would take it for friction"
        left_out = "that is the load on the rod" if load else "nothing is on the rod"
        raise ScoringError(
            f"column {LOAD_COLUMN!r} is given, but this model {why}; expected {list(graph.inputs)}; serve a model that "
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


def _places_by_recording(rows: pd.DataFrame) -> list[NDArray[np.intp]]:
    """Return the places of each recording's rows; all rows are one where no recording is named."""
    if RECORDING_COLUMN not in rows.columns:
        return [np.arange(len(rows))]
    by_name: dict[str, list[int]] = {}
    for row, name in enumerate(rows[RECORDING_COLUMN].tolist()):
        if not isinstance(name, str | int) or isinstance(name, bool) or name == "":
            raise ScoringError(
                f"{RECORDING_COLUMN} is {name!r} at row {row}; expected the name of a recording in every row, or no "
                "such column when all rows are one recording"
            )
        by_name.setdefault(str(name), []).append(row)
    return [np.array(places) for places in by_name.values()]


def _all_within(inside: NDArray[np.bool_], memory: int) -> NDArray[np.bool_]:
    """Return where this row and the ``memory - 1`` rows before it are all inside."""
    outside_so_far = np.concatenate([[0], np.cumsum(~inside)])
    ends = np.arange(1, len(inside) + 1)
    return np.asarray(outside_so_far[ends] == outside_so_far[np.maximum(0, ends - memory)])


mlflow.models.set_model(FrictionScoringModel())
