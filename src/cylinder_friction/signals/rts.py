"""The Rauch-Tung-Striebel smoother: the optimal off-line filter of a linear model."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

from cylinder_friction.arrays import Array
from cylinder_friction.signals.causal_chain import CausalFilter
from cylinder_friction.signals.kalman import KalmanModel, constant_jerk, random_walk
from cylinder_friction.signals.smooth_signals import SignalFilter, Support

if TYPE_CHECKING:
    from cylinder_friction.signals.kalman_passes import SteadyKalman


@lru_cache(maxsize=8)  # a model keeps its gains, which take longer than smoothing a recording
def _models(pressure_time_s: float, motion_time_s: float, sample_time_s: float) -> tuple[KalmanModel, KalmanModel]:
    walk = random_walk(sample_time_s / pressure_time_s, 1.0)
    return walk, constant_jerk(motion_time_s**-3, 1.0, sample_time_s)


@dataclass(frozen=True)
class RtsSmoother(SignalFilter):
    """Constant jerk for the position, random walks for the pressures (Rauch, Tung and Striebel 1965).

    How much is smoothed follows from the ratio of process noise to sensor noise alone, and that ratio is a time: in it
    a signal moves by as much as its sensor's noise. So no noise has to be known, at any sample time.
    """

    pressure_time_s: float = 0.01  # In which a pressure wanders by its noise [s]
    # In which jerk, constant within one sample and white between samples, moves a position by its noise [s]
    motion_time_s: float = 0.015

    def models(self, sample_time_s: float) -> tuple[KalmanModel, KalmanModel]:
        """Return the models of a pressure and of the position, in units of their sensors' noise."""
        return _models(self.pressure_time_s, self.motion_time_s, sample_time_s)

    def causal(self) -> KalmanFilter:
        """Return the Kalman filter of the same models: this smoother without its look-ahead."""
        return KalmanFilter(self)

    def smooth_force(self, force_n: Array, sample_time_s: float) -> Array:
        from cylinder_friction.signals.kalman_passes import smooth_states  # Numba: labels need not wait for it

        return smooth_states(self.models(sample_time_s)[0], force_n)[:, 0].copy()

    def motion(self, position_m: Array, sample_time_s: float) -> tuple[Array, Array]:
        from cylinder_friction.signals.kalman_passes import smooth_states

        states = smooth_states(self.models(sample_time_s)[1], position_m)
        return states[:, 1].copy(), states[:, 2].copy()

    def support(self, sample_time_s: float) -> Support:
        """Return the rows after which less than 1 % of a disturbance is left; strictly it looks at all rows."""
        rows = max(model.memory_rows() for model in self.models(sample_time_s))
        return Support(rows, rows)


@dataclass(frozen=True)
class KalmanFilter(CausalFilter):
    """The Kalman filter of an ``RtsSmoother``, with its steady gains."""

    smoother: RtsSmoother

    def block(self, sample_time_s: float) -> SteadyKalman:
        from cylinder_friction.signals.kalman_passes import SteadyKalman

        return SteadyKalman(*self.smoother.models(sample_time_s))

    def support(self, sample_time_s: float) -> Support:
        return Support(self.smoother.support(sample_time_s).before, 0)
