"""The hybrid on ONNX Runtime: the very graphs that are stored, run as any other runtime would run them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import onnxruntime

from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.estimators.onnx_files import forest_to_onnx, network_to_onnx
from cylinder_friction.realtime.forest import Forest
from cylinder_friction.realtime.lstm import Lstm, LstmState

if TYPE_CHECKING:
    from pathlib import Path

    import onnx
    from numpy.typing import NDArray

    from cylinder_friction.estimators.base import FrictionEstimator
    from cylinder_friction.estimators.hybrid import HybridParts
    from cylinder_friction.realtime.lstm import LstmWeights

    Single = NDArray[np.float32]


class OnnxHybrid(HybridEstimator):
    """A trained hybrid whose network and forest run on ONNX Runtime, on one thread."""

    def _set(self, parts: HybridParts) -> None:
        super()._set(parts)
        self._network = OnnxLstm(parts.network)
        self._forest = None if parts.forest is None else onnx_forest(parts.forest)


def load_onnx(folder: Path) -> FrictionEstimator:
    """Return the estimator saved in ``folder``, a hybrid running on ONNX Runtime and any other kind as it is.

    Raises:
        FileNotFoundError: The folder holds no saved estimator.
        ValueError: The kind is not known.
    """
    stored = load_estimator(folder)
    if not isinstance(stored, HybridEstimator):
        return stored
    assert stored.parts is not None
    result = OnnxHybrid(stored.cylinder, stored.design, inputs=stored.inputs)
    result.sample_time_s, result.training_range = stored.sample_time_s, stored.training_range
    result._set(stored.parts)
    return result


class OnnxLstm(Lstm):
    """Runs the stored network; its state is what goes into the graph and comes out of it."""

    def __init__(self, weights: LstmWeights) -> None:
        super().__init__(weights)
        self._session = one_thread_session(network_to_onnx(weights))

    def advance(self, state: LstmState, features: Single) -> tuple[Single, Single]:
        if len(features) == 0:
            return np.empty((0, self.weights.nodes), dtype=np.float32), np.empty(0, dtype=np.float32)
        outputs = self._session.run(
            ["hidden", "head", "hidden_out", "cell_out"],
            {
                "features": np.ascontiguousarray(features, dtype=np.float32)[:, None, :],
                "hidden_in": state.hidden[:, None, :],
                "cell_in": state.cell[:, None, :],
            },
        )
        hidden, head, hidden_out, cell_out = (np.asarray(output, dtype=np.float32) for output in outputs)
        state.hidden, state.cell = hidden_out[:, 0], cell_out[:, 0]
        return hidden[:, 0], head[:, 0, 0]


class OnnxForest(Forest):
    """Runs the stored forest."""

    session: Any

    def predict(self, features: Single) -> NDArray[np.float64]:
        if len(features) == 0:
            return np.empty(0)
        name = self.session.get_inputs()[0].name
        output = self.session.run(None, {name: np.ascontiguousarray(features, dtype=np.float32)})[0]
        return np.asarray(output, dtype=np.float64).reshape(-1)


def onnx_forest(arrays: Forest) -> OnnxForest:
    """Return a forest that ONNX Runtime runs."""
    forest = OnnxForest(**{name: getattr(arrays, name) for name in Forest.__dataclass_fields__})
    object.__setattr__(forest, "session", one_thread_session(forest_to_onnx(arrays)))
    return forest


def one_thread_session(model: onnx.ModelProto) -> Any:
    """Return a session on one thread that never spins, so that a server's other work is not starved."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    options.inter_op_num_threads = 1
    options.execution_mode = onnxruntime.ExecutionMode.ORT_SEQUENTIAL
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.add_session_config_entry("session.inter_op.allow_spinning", "0")
    options.log_severity_level = 3
    return onnxruntime.InferenceSession(model.SerializeToString(), options, providers=["CPUExecutionProvider"])
