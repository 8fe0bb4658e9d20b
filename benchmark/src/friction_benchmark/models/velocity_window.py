"""A window of past velocities whose spans grow with age: fine for the recent past, and seconds long.

Friction depends on a reversal for milliseconds and on a standstill for seconds; a window of equal steps would either be
too short or too wide for a small network.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numba
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from cylinder_friction.arrays import Array

Single = NDArray[np.float32]

EVERY = 4
"""Samples between two steps of the window: 20 ms at 200 Hz."""

SPANS = np.repeat(np.array([1, 2, 4, 8, 16, 32, 64]), [6, 4, 4, 4, 4, 3, 2])
"""Steps that each mean of the window spans, newest first; together 7.2 s at 200 Hz."""

FAST_M_S, CREEP_M_S = 0.05, 5e-3
"""Scales of the two forms of each mean: linear, and through a soft limit."""

WINDOW_INPUTS = 2 * len(SPANS)


@dataclass
class WindowState:
    """Ring buffer of past velocities [m/s]; ``(samples until the next step, newest place)``; the current window."""

    ring: Array
    place: NDArray[np.int64]
    window: Single


def new_window() -> WindowState:
    """Return the state before the first sample, as if at rest until then."""
    return WindowState(np.zeros(int(SPANS.sum())), np.zeros(2, dtype=np.int64), np.zeros(WINDOW_INPUTS, np.float32))


def advance_window(state: WindowState, velocity_m_s: Array) -> tuple[Single, NDArray[np.bool_]]:
    """Return the window at each sample, shape ``(n, WINDOW_INPUTS)``, and where it stepped; changes ``state``."""
    return _advance(np.ascontiguousarray(velocity_m_s, dtype=np.float64), state.ring, state.place, state.window, SPANS)


@numba.njit(cache=True)
def _advance(
    velocity: Array, ring: Array, place: NDArray[np.int64], window: Single, spans: NDArray[np.int64]
) -> tuple[Single, NDArray[np.bool_]]:
    result = np.empty((velocity.shape[0], window.shape[0]), dtype=np.float32)
    stepped = np.zeros(velocity.shape[0], dtype=np.bool_)
    for row in range(velocity.shape[0]):
        if place[0] == 0:
            place[0] = EVERY
            place[1] = (place[1] + 1) % ring.shape[0]
            ring[place[1]] = velocity[row]
            _fill(ring, place[1], spans, window)
            stepped[row] = True
        place[0] -= 1
        result[row] = window
    return result, stepped


@numba.njit(cache=True)
def _fill(ring: Array, newest: int, spans: NDArray[np.int64], window: Single) -> None:
    count, at = spans.shape[0], newest
    for index in range(count):
        total = 0.0
        for _ in range(spans[index]):
            total += ring[at]
            at = at - 1 if at > 0 else ring.shape[0] - 1
        mean = total / spans[index]
        window[index] = np.float32(mean / FAST_M_S)
        window[count + index] = np.float32(mean / (abs(mean) + CREEP_M_S))
