"""Step graph and sequence graph give what Python gives, whatever the model's shape and the samples."""

import numpy as np
import onnxruntime
import pytest

from contracts.tolerances import TOLERANCES_N
from cylinder_friction.deployment.onnx_graphs.sequence import sequence_graph
from cylinder_friction.deployment.onnx_graphs.step import step_graph
from cylinder_friction.deployment.onnx_graphs.stream import OnnxStepStream, open_sequence, open_step
from cylinder_friction.realtime.flags import Flag
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.realtime.stream import RealTimeStream
from learned_offset import learning


def rolled(stream: OnnxStepStream | RealTimeStream, samples: np.ndarray) -> np.ndarray:
    """Return friction, lower, upper and flags of samples stepped through, shape ``(n, 4)``."""
    return np.array([stream.step(*sample) for sample in samples]).reshape(-1, 4)


def at_once(model: StepModel, samples: np.ndarray) -> np.ndarray:
    newtons, flags = open_sequence(sequence_graph(model)).run(samples)
    return np.column_stack([newtons, flags])


def test_the_samples_have_every_flag(golden_model: StepModel, samples: np.ndarray) -> None:
    flags = rolled(RealTimeStream(learning(golden_model)), samples)[:, 3].astype(int)
    assert np.bitwise_or.reduce(flags) == sum(Flag) - Flag.INVALID_OTHER, "the model has no other input"


def test_the_step_graph_meets_python(model: StepModel, samples: np.ndarray) -> None:
    expected = rolled(RealTimeStream(model), samples)
    got = rolled(open_step(step_graph(model)), samples)
    np.testing.assert_array_equal(got[:, 3], expected[:, 3])
    np.testing.assert_allclose(got[:, :3], expected[:, :3], rtol=0.0, atol=TOLERANCES_N["onnx_step"])
    assert np.quantile(np.abs(got[:, 0] - expected[:, 0]), 0.99) < 0.01


def test_the_step_graph_rolled_is_the_sequence_graph(model: StepModel, samples: np.ndarray) -> None:
    stepped, whole = rolled(open_step(step_graph(model)), samples), at_once(model, samples)
    np.testing.assert_array_equal(whole[:, 3], stepped[:, 3])
    np.testing.assert_allclose(whole[:, :3], stepped[:, :3], rtol=0.0, atol=TOLERANCES_N["onnx_sequence"])
    assert np.quantile(np.abs(whole[:, 0] - stepped[:, 0]), 0.99) < 0.01


@pytest.mark.parametrize("rows", [0, 1, 2, 5])
def test_short_recordings(golden_model: StepModel, samples: np.ndarray, rows: int) -> None:
    few = samples[100 : 100 + rows]
    np.testing.assert_allclose(at_once(golden_model, few), rolled(RealTimeStream(golden_model), few), atol=1e-3)


def test_tiny_states_become_zero(golden_model: StepModel) -> None:
    graph = step_graph(golden_model)
    session = onnxruntime.InferenceSession(graph.SerializeToString(), providers=["CPUExecutionProvider"])
    feed = {port.name: np.zeros(port.shape, np.float64) for port in session.get_inputs()}
    feed["sample"][0] = 0.5 * np.add(golden_model.guard.trained_lower, golden_model.guard.trained_upper)
    feed["network"] = np.full(feed["network"].shape, 1e-39, np.float32)
    after = session.run(["network_out"], feed)[0]
    assert ((after == 0.0) | (np.abs(after) > 1e-30)).all()
