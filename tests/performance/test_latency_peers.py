"""Peers estimate what the estimator does; a window, the output of a fresh network on the last samples."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from latency_peers import WINDOW, LugreInNumpy, MachineTail, OnnxWindow, TorchWindow
from training_framework import scikit_learn_forest

from cylinder_friction.estimators.front_end import FrontEndBlock
from cylinder_friction.estimators.hybrid import forest_input
from cylinder_friction.estimators.lugre import PressureLugreEstimator
from cylinder_friction.realtime.lstm import Lstm

if TYPE_CHECKING:
    from pathlib import Path

    from cylinder_friction.estimators.hybrid import HybridEstimator
    from cylinder_friction.estimators.lugre import LugreEstimator
    from cylinder_friction.realtime.model import StepModel


def windowed(hybrid: HybridEstimator, golden_model: StepModel, samples: np.ndarray) -> np.ndarray:
    """The estimate from a fresh network over the last ``WINDOW`` rows of features, by the library's own parts."""
    assert hybrid.parts is not None
    assert golden_model.network is not None
    assert golden_model.forest is not None
    front_end = FrontEndBlock(hybrid.parts.front_end)
    features, base_n = front_end.advance(front_end.new_state(), samples)
    padded = np.concatenate([np.repeat(features[:1], WINDOW - 1, axis=0), features])
    network, result = Lstm(golden_model.network), []
    for row in range(len(samples)):
        hidden, head = network.advance(network.new_state(), padded[row : row + WINDOW])
        seen = forest_input(hybrid.design, hidden[-1:], head[-1:], features[row : row + 1])
        correction = float(head[-1]) + float(golden_model.forest.predict(seen)[0])
        result.append(base_n[row] + golden_model.target_mean_n + golden_model.target_scale_n * correction)
    return np.array(result)


@pytest.mark.parametrize("kind", [TorchWindow, OnnxWindow])
def test_a_window_estimates_what_a_fresh_network_does(
    kind: type[TorchWindow | OnnxWindow], hybrid: HybridEstimator, golden_model: StepModel, samples: np.ndarray
) -> None:
    peer = kind(golden_model)
    newtons = [peer.step(*sample) for sample in samples[:60].tolist()]
    np.testing.assert_allclose(newtons, windowed(hybrid, golden_model, samples[:60]), rtol=0.0, atol=0.05)


@pytest.mark.parametrize("sees", ["hidden", "nothing"])
def test_both_windows_agree_on_other_designs(sees: str, golden_model: StepModel, samples: np.ndarray) -> None:
    assert golden_model.network is not None
    assert golden_model.forest is not None
    leaf = golden_model.forest.feature < 0
    narrow = replace(
        golden_model.forest,
        feature=np.where(leaf, -1, golden_model.forest.feature % golden_model.network.nodes),
        inputs=golden_model.network.nodes,
    )
    other = replace(
        golden_model,
        forest=narrow if sees == "hidden" else None,
        forest_sees=sees,
        head_counts=sees == "nothing",
        base_taps=np.zeros((3, 1)),
    )
    ours, theirs = TorchWindow(other), OnnxWindow(other)
    newtons = np.array([[each.step(*sample) for each in (ours, theirs)] for sample in samples[:30].tolist()])
    np.testing.assert_allclose(newtons[:, 0], newtons[:, 1], rtol=0.0, atol=0.05)
    assert np.ptp(newtons[:, 0]) > 0.0


def test_the_forest_is_the_same_tree_for_tree(golden_model: StepModel) -> None:
    assert golden_model.forest is not None
    rows = np.random.default_rng(1).normal(size=(500, golden_model.forest.inputs)).astype(np.float32)
    forest = scikit_learn_forest(golden_model.forest)
    np.testing.assert_allclose(forest.predict(rows), golden_model.forest.predict(rows), rtol=1e-6, atol=1e-9)
    assert sum(tree.tree_.node_count for tree in forest.estimators_) == len(golden_model.forest.feature)


def test_lugre_in_numpy_is_lugre(lugre: LugreEstimator, samples: np.ndarray) -> None:
    stream = LugreInNumpy(lugre)
    newtons = [stream.step(*sample) for sample in samples.tolist()]
    assert np.ptp(newtons) > 1.0
    np.testing.assert_allclose(newtons, lugre.advance(lugre.new_state(), samples), rtol=1e-9, atol=1e-9)


def test_it_scales_with_pressure_where_the_model_does(lugre: LugreEstimator, samples: np.ndarray) -> None:
    assert lugre.parameters is not None
    assert lugre.causal_velocity is not None
    scaled = PressureLugreEstimator(lugre.cylinder)
    parameters = replace(lugre.parameters, pressure_slope_n_pa=1e-5, retract_ratio=1.2)
    scaled.sample_time_s = lugre.sample_time_s
    scaled._use(parameters, replace(lugre.causal_velocity, backlash_m=0.0, dead_band_m_s=1e-3))
    stream = LugreInNumpy(scaled)
    newtons = [stream.step(*sample) for sample in samples.tolist()]
    np.testing.assert_allclose(newtons, scaled.advance(scaled.new_state(), samples), rtol=1e-9, atol=1e-9)


class Steady:
    """Reports the time it was given."""

    name, title, group, timer_ns = "steady", "steady", "step", 0.0

    def __init__(self, step_ns: int) -> None:
        self.step_ns = step_ns

    def run(self, samples: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros(len(samples)), np.full(len(samples), self.step_ns)


def test_the_machines_own_tail_is_measured_on_steps_of_the_length_asked_for(
    samples: np.ndarray, tmp_path: Path
) -> None:
    folders = [tmp_path / "short", tmp_path / "long"]
    for folder in folders:
        folder.mkdir()
    short, long = (
        MachineTail(Steady(step_ns), samples, folder) for step_ns, folder in zip((1_000, 100_000), folders, strict=True)
    )
    friction, times = long.run(samples)
    assert len(times) == len(friction) == len(samples)
    assert long._links > 20 * short._links > 0
