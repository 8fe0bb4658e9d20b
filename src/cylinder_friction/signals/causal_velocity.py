"""Velocity from raw position, sample by sample, that is exactly zero at standstill and keeps slow creep.

A velocity dead band cannot tell creep at 1 mm/s from the noise of a 12-bit potentiometer. Travel can: creep adds up,
noise does not. So velocity counts only while the smoothed position has lately pushed against a play of some tens of
micrometres, and only in the direction of the push.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numba
import numpy as np

from cylinder_friction.signals.backlash import AGE, DIRECTION, new_play, push
from cylinder_friction.signals.causal import FirFilter, FirState, one_sided_savitzky_golay_taps

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cylinder_friction.recordings.recording import Recording

    Array = NDArray[np.float64]


@dataclass(frozen=True)
class MotionSense:
    """How velocity is made from raw position.

    Attributes:
        window: Samples of the one-sided Savitzky-Golay filter that gives smooth position and velocity; after the
            last push against the play, velocity counts for as long.
        order: Order of its polynomial.
        play_m: Half-width of the play; 0 lets everything through [m].
        dead_band_m_s: Slower is zero whatever the play says [m/s].
    """

    window: int
    order: int
    play_m: float
    dead_band_m_s: float

    def block(self, sample_time_s: float) -> MotionBlock:
        """Return the causal block at a sample time."""
        return MotionBlock(self, sample_time_s)

    def velocity(self, recording: Recording) -> Array:
        """Return the velocity through a whole recording [m/s], shape ``(n,)``."""
        block = self.block(recording.sample_time_s)
        return block.advance(block.new_state(), recording.samples()[:, 2:3])


@dataclass
class MotionState:
    """The filter's last positions, and the play [m], its age in samples."""

    position: FirState
    play: Array


class MotionBlock:
    """Position [m], shape ``(n, 1)``, to velocity [m/s], shape ``(n,)``; cutting the input changes no bit."""

    def __init__(self, sense: MotionSense, sample_time_s: float) -> None:
        taps = [
            one_sided_savitzky_golay_taps(sense.window, sense.order, derivative, sample_time_s)[None, :]
            for derivative in (0, 1)
        ]
        self._sense = sense
        self._filter = FirFilter(np.stack(taps))

    def new_state(self) -> MotionState:
        return MotionState(FirState(), new_play())

    def advance(self, state: MotionState, position_m: Array) -> Array:
        smooth = self._filter.advance(state.position, position_m)
        return _gated(smooth, state.play, self._sense.play_m, self._sense.dead_band_m_s, self._sense.window)


@numba.njit(cache=True)
def _gated(smooth: Array, play: Array, half_width: float, dead_band: float, lasting: int) -> Array:
    velocity = np.zeros(smooth.shape[0])
    for row in range(smooth.shape[0]):
        rate = smooth[row, 1]
        push(smooth[row, 0], play, half_width, 0.0, 1.0)
        counts = play[AGE] < lasting and rate * play[DIRECTION] > 0.0
        if abs(rate) >= dead_band and (half_width == 0.0 or counts):
            velocity[row] = rate
    return velocity
