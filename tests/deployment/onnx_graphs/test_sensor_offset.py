"""Both graphs learn the offset of the sensors' zeros as Python does, and start from one that is known."""

from dataclasses import replace

import numpy as np
import pytest

from contracts.tolerances import TOLERANCES_N
from cylinder_friction.deployment.onnx_graphs.sequence import sequence_graph
from cylinder_friction.deployment.onnx_graphs.step import step_graph
from cylinder_friction.deployment.onnx_graphs.stream import OnnxSequence, OnnxStepStream, open_sequence, open_step
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.realtime.stream import RealTimeStream
from learned_offset import learning

Outputs = tuple[np.ndarray, np.ndarray, np.ndarray]
CLOSE_N = 1e-3
"""Of offset and uncertainty: no forest is between them and the samples."""


@pytest.fixture(scope="module")
def learner(golden_model: StepModel) -> StepModel:
    return learning(golden_model)


@pytest.fixture(scope="module")
def stepping(learner: StepModel) -> OnnxStepStream:
    return open_step(step_graph(learner))


@pytest.fixture(scope="module")
def at_once(learner: StepModel) -> OnnxSequence:
    return open_sequence(sequence_graph(learner))


def expected_of(model: StepModel, samples: np.ndarray, *start: float | None) -> Outputs:
    """Return newtons, flags and offsets of the compiled step."""
    stream = RealTimeStream(model)
    stream.reset(*start)
    newtons, offsets, flags = stream.run_with_offset(samples)
    return newtons, flags, offsets


def rolled(stream: OnnxStepStream, samples: np.ndarray, *start: float | None) -> Outputs:
    stream.reset(*start)
    outputs, offsets = [], []
    for sample in samples:
        outputs.append(stream.step(*sample))
        offsets.append(stream.offset)
    return np.array([each[:3] for each in outputs]), np.array([each.flags for each in outputs]), np.array(offsets)


def together(sequence: OnnxSequence, samples: np.ndarray, *start: float | None) -> Outputs:
    return *sequence.run(samples, *start), sequence.offsets(samples, *start)


def assert_equal(got: Outputs, expected: Outputs) -> None:
    np.testing.assert_array_equal(got[1], expected[1])
    np.testing.assert_allclose(got[0], expected[0], rtol=0.0, atol=TOLERANCES_N["onnx_step"])
    np.testing.assert_allclose(got[2], expected[2], rtol=0.0, atol=CLOSE_N)


@pytest.mark.parametrize(("settling", "block"), [(0, 1), (7, 3), (3, 7), (0, 150)])
def test_whatever_makes_a_block(learner: StepModel, offset_samples: np.ndarray, settling: int, block: int) -> None:
    tracker, samples = learner.offset, offset_samples[:2000]
    assert tracker is not None
    model = replace(
        learner, offset=replace(tracker, settings=tracker.settings._replace(settling=settling, block=block))
    )
    expected = expected_of(model, samples)
    assert_equal(rolled(open_step(step_graph(model)), samples), expected)
    assert_equal(together(open_sequence(sequence_graph(model)), samples), expected)
    assert len(np.unique(expected[2][:, 0])) > 1


@pytest.mark.parametrize("rows", [0, 1, 2, 30])
def test_before_the_first_valid_sample_the_offset_is_what_was_given(
    stepping: OnnxStepStream, at_once: OnnxSequence, learner: StepModel, rows: int
) -> None:
    nothing = np.full((rows, 3), np.nan)
    newtons, flags, offsets = expected_of(learner, nothing, 25.0, 5.0)
    assert_equal(together(at_once, nothing, 25.0, 5.0), (newtons, flags, offsets))
    if rows:
        assert_equal(rolled(stepping, nothing, 25.0, 5.0), (newtons, flags, offsets))
        assert set(offsets[:, 0]) == {25.0}


def test_an_offset_for_a_graph_that_learns_none_is_refused(golden_model: StepModel, samples: np.ndarray) -> None:
    stream, sequence = open_step(step_graph(golden_model)), open_sequence(sequence_graph(golden_model))
    assert stream.offset == (0.0, 0.0)
    for start in ((1.0, None), (0.0, 5.0)):
        with pytest.raises(ValueError, match="this estimator learns no sensor offset"):
            stream.reset(*start)
        with pytest.raises(ValueError, match="this estimator learns no sensor offset"):
            sequence.run(samples[:1], *start)


@pytest.mark.parametrize("start", [(np.nan, None), (np.inf, 1.0), (0.0, -1.0), (0.0, np.nan), (0.0, np.inf)])
def test_an_impossible_offset_is_refused(stepping: OnnxStepStream, start: tuple[float, float | None]) -> None:
    with pytest.raises(ValueError, match="expected a finite offset and an uncertainty of at least 0 N, but got"):
        stepping.reset(*start)
