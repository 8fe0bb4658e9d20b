"""Every runtime and the peer take their steps and estimate what they should; never how fast."""

from __future__ import annotations

import shutil
from typing import TYPE_CHECKING

import numpy as np
import pytest
from latency import ROUNDS, WINDOW, TorchWindow, measure, table

from cylinder_friction.estimators.hybrid import forest_input
from model_shapes import predicted

if TYPE_CHECKING:
    from pathlib import Path

    from cylinder_friction.estimators.hybrid import HybridEstimator
    from cylinder_friction.estimators.lugre import LugreEstimator
    from cylinder_friction.realtime.model import StepModel

STEPS = 100
C = [f"C, {which}" for which in ("double filters, -O3 -march=native", "double filters, -O2")]
C.append("C, all single precision, -O3 -march=native")
PEER = "PyTorch + scikit-learn, window of 40"


@pytest.mark.skipif(shutil.which("gcc") is None, reason="there is no C compiler")
@pytest.mark.parametrize(
    ("model", "python"),
    [("hybrid", ["Python, estimator.real_time()", PEER]), ("lugre", ["Python, estimator.stream()"])],
)
def test_every_runtime_takes_every_step_and_estimates_what_the_estimator_does(
    model: str, python: list[str], request: pytest.FixtureRequest, samples: np.ndarray, tmp_path: Path
) -> None:
    estimator: HybridEstimator | LugreEstimator = request.getfixturevalue(model)
    measured = measure(estimator, samples, tmp_path, STEPS)
    assert [runtime.title for runtime in measured] == [*C, *python]
    for runtime in measured:
        assert (sum(map(len, runtime.timed)), len(runtime.first)) == (STEPS, ROUNDS)
        assert runtime.largest_difference_n < 0.5 or runtime.title == PEER
    assert [line.partition("  C, ")[0][:9] for line in table(measured).splitlines()[1:2]] == ["     1.00"]
    assert all(runtime.title in table(measured) for runtime in measured)


def windowed(hybrid: HybridEstimator, golden_model: StepModel, samples: np.ndarray) -> np.ndarray:
    """The estimate from a fresh network over the last ``WINDOW`` rows of features, by the library's own parts."""
    assert hybrid.parts is not None
    assert golden_model.network is not None
    assert golden_model.forest is not None
    features, base_n = hybrid.parts.front_end.run(samples)
    padded = np.concatenate([np.repeat(features[:1], WINDOW - 1, axis=0), features])
    result = []
    for row in range(len(samples)):
        hidden, head = golden_model.network.run(padded[row : row + WINDOW])
        seen = forest_input(hybrid.design, hidden[-1:], head[-1:], features[row : row + 1])
        correction = float(head[-1]) + float(predicted(golden_model.forest, seen)[0])
        result.append(base_n[row] + golden_model.target_mean_n + golden_model.target_scale_n * correction)
    return np.array(result)


def test_a_window_estimates_what_a_fresh_network_does(
    hybrid: HybridEstimator, golden_model: StepModel, samples: np.ndarray
) -> None:
    peer = TorchWindow(golden_model)
    newtons = [peer.step(*sample) for sample in samples[:60].tolist()]
    np.testing.assert_allclose(newtons, windowed(hybrid, golden_model, samples[:60]), rtol=0.0, atol=0.05)
