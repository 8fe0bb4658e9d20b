"""What a user would write from a paper: filters in numpy, the network over the last 40 samples, then the forest.

No guard, no bounds, no flags: less work than a step of the others, network and forest excepted.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import torch

from cylinder_friction.deployment.latency.rebuilt import TorchNetwork, scikit_learn_forest
from cylinder_friction.deployment.latency.window_graph import window_session

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cylinder_friction.realtime.model import StepModel

    Single = NDArray[np.float32]

WINDOW = 40
"""Samples that the published estimator looks back."""


class WindowFeatures:
    """The last raw samples, and the last 40 rows of features made of them; the first sample fills both."""

    def __init__(self, model: StepModel) -> None:
        self._model = model
        features, channels, lags = model.feature_taps.shape
        base_lags = model.base_taps.shape[1]
        taps = np.zeros((features + 1, max(lags, base_lags), channels))
        taps[:features, :lags] = model.feature_taps.transpose(0, 2, 1)
        taps[features, :base_lags] = model.base_taps.T
        self._taps = taps.reshape(features + 1, -1)
        self._history = np.zeros(taps.shape[1:])
        self._started = False
        self.rows = np.zeros((1, WINDOW, features), dtype=np.float32)

    def push(self, pressure_1_pa: float, pressure_2_pa: float, position_m: float) -> float:
        """Take a sample; returns the force that network and forest correct [N]."""
        model, first = self._model, not self._started
        if first:
            self._history[:] = pressure_1_pa, pressure_2_pa, position_m
            self._started = True
        self._history[1:] = self._history[:-1]
        self._history[0] = pressure_1_pa, pressure_2_pa, position_m
        filtered = self._taps @ self._history.ravel()
        value, limit = filtered[:-1], model.feature_limits
        value = np.where(limit > 0.0, value / (np.abs(value) + np.where(limit > 0.0, limit, 1.0)), value)
        self.rows[0, :-1] = self.rows[0, 1:]
        self.rows[0, -1] = (value - model.feature_mean) / model.feature_scale
        if first:
            self.rows[0, :-1] = self.rows[0, -1]
        return float(filtered[-1]) + model.target_mean_n


class TorchWindow:
    """PyTorch and scikit-learn."""

    def __init__(self, model: StepModel) -> None:
        assert model.network is not None
        self._model, self._features = model, WindowFeatures(model)
        self._network = TorchNetwork(model.network)
        self._forest = None if model.forest is None else scikit_learn_forest(model.forest)

    def step(self, pressure_1_pa: float, pressure_2_pa: float, position_m: float) -> float:
        """Return friction [N]."""
        model = self._model
        friction_n = self._features.push(pressure_1_pa, pressure_2_pa, position_m)
        with torch.no_grad():
            hidden, head = self._network(torch.from_numpy(self._features.rows))
        if model.head_counts:
            friction_n += model.target_scale_n * head.item()
        if self._forest is not None:
            seen = hidden.numpy()
            if model.forest_sees == "hidden_head_features":
                seen = np.concatenate([seen, head.numpy(), self._features.rows[:, -1]], axis=1)
            friction_n += model.target_scale_n * float(self._forest.predict(seen)[0])
        return friction_n


class OnnxWindow:
    """The same network and forest in one ONNX graph, on one thread of ONNX Runtime."""

    def __init__(self, model: StepModel) -> None:
        self._model, self._features = model, WindowFeatures(model)
        self._session = window_session(model)

    def step(self, pressure_1_pa: float, pressure_2_pa: float, position_m: float) -> float:
        """Return friction [N]."""
        friction_n = self._features.push(pressure_1_pa, pressure_2_pa, position_m)
        (correction,) = self._session.run(None, {"window": self._features.rows})
        return friction_n + self._model.target_scale_n * float(correction[0, 0])
