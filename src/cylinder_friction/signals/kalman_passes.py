"""A Kalman filter's pass over measurements, and the smoother's pass back over it."""

from dataclasses import dataclass

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.machine_code import compiled
from cylinder_friction.signals.kalman import KalmanModel


@dataclass
class KalmanState:
    """Pressure 1, pressure 2, position, velocity, acceleration; None before the first sample."""

    estimate: Array | None = None


class SteadyKalman:
    """The Kalman filter with its steady gains, as a causal block: the causal form of ``RtsSmoother``.

    It assumes that everything stood still at the first sample before it. A pressure is a random walk; the position's
    model has position, velocity and acceleration.
    """

    def __init__(self, pressure: KalmanModel, position: KalmanModel) -> None:
        pressure_gain, position_gain = (model.gains.filter[-1:] for model in (pressure, position))
        self._signals = (
            (pressure.transition, pressure_gain, slice(0, 1)),
            (pressure.transition, pressure_gain, slice(1, 2)),
            (position.transition, position_gain, slice(2, 5)),
        )

    def new_state(self) -> KalmanState:
        return KalmanState()

    def advance(self, state: KalmanState, inputs: Array) -> Array:
        inputs = np.ascontiguousarray(inputs, dtype=np.float64)
        if len(inputs) == 0:
            return np.empty((0, 4))
        if state.estimate is None:
            state.estimate = np.concatenate([inputs[0], np.zeros(2)])
        result = np.empty((len(inputs), 5))
        for column, (transition, gain, own) in enumerate(self._signals):
            measured = np.ascontiguousarray(inputs[:, column])
            _, result[:, own] = _filter(transition, gain, state.estimate[own], measured)
        return result[:, [0, 1, 3, 4]]


def smooth_states(model: KalmanModel, measured: Array) -> Array:
    """Smooth the states, shape ``(n, k)``, from measurements of the first state, shape ``(n,)``."""
    gains = model.gains
    # Subtracting the first value keeps numbers small, and gives the model's first state zero mean.
    first, state = measured[0], np.zeros(len(model.transition))
    forward = _filter(model.transition, gains.filter, state, np.ascontiguousarray(measured - first))
    states = _smooth(gains.smoother, *forward)
    states[:, 0] += first
    return states


@compiled
def _filter(transition: Array, gains: Array, state: Array, measured: Array) -> tuple[Array, Array]:
    """Compute the predicted and the updated states, shape ``(n, k)``; ``state`` becomes the last one.

    At the start ``state`` is the state of the row before. The last gain holds for all later rows.
    """
    rows, size = measured.shape[0], transition.shape[0]
    predicted, updated = np.zeros((rows, size)), np.zeros((rows, size))
    for row in range(rows):
        gain = gains[min(row, gains.shape[0] - 1)]
        for i in range(size):
            total = 0.0
            for j in range(size):
                total += transition[i, j] * state[j]
            predicted[row, i] = total
        surprise = measured[row] - predicted[row, 0]
        for i in range(size):
            updated[row, i] = predicted[row, i] + gain[i] * surprise
        state[:] = updated[row]
    return predicted, updated


@compiled
def _smooth(gains: Array, predicted: Array, updated: Array) -> Array:
    """Correct the updated states by the measurements of later rows."""
    rows, size = updated.shape
    for row in range(rows - 2, -1, -1):
        gain = gains[min(row, gains.shape[0] - 1)]
        for i in range(size):
            total = 0.0
            for j in range(size):
                total += gain[i, j] * (updated[row + 1, j] - predicted[row + 1, j])
            updated[row, i] += total
    return updated
