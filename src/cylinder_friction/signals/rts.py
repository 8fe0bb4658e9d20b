"""The Rauch-Tung-Striebel smoother: the optimal off-line filter of a linear model."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from types import ModuleType
from typing import TYPE_CHECKING

from cylinder_friction.arrays import Array
from cylinder_friction.signals.causal_chain import CausalFilter
from cylinder_friction.signals.kalman import KalmanModel, constant_jerk, random_walk
from cylinder_friction.signals.smooth_signals import SignalFilter, Support

if TYPE_CHECKING:
    from cylinder_friction.signals.kalman_passes import SteadyKalman


def _passes() -> ModuleType:
    from cylinder_friction.signals import kalman_passes  # Numba: labels need not wait for it

    return kalman_passes


@lru_cache(maxsize=8)  # a model keeps its gains, which take longer than smoothing a recording
def _models(pressure_time_s: float, motion_time_s: float, sample_time_s: float) -> tuple[KalmanModel, KalmanModel]:
    walk = random_walk(sample_time_s / pressure_time_s, 1.0)
    return walk, constant_jerk(motion_time_s**-3, 1.0, sample_time_s)


@dataclass(frozen=True)
class RtsSmoother(SignalFilter):
    """Constant jerk for the position, random walks for the pressures (Rauch, Tung and Striebel 1965).

    The smoothing depends only on the ratio of process noise to sensor noise. This ratio is stated as a time, in which a
    signal moves by as much as its sensor's noise. So no noise has to be known, at any sample time.
    """

    pressure_time_s: float = 0.01  # Time in which a pressure moves by its noise [s]
    # Time in which a jerk, constant within a sample and white between samples, moves a position by its noise [s]
    motion_time_s: float = 0.015

    def models(self, sample_time_s: float) -> tuple[KalmanModel, KalmanModel]:
        """Return the models of a pressure and of the position, in units of their sensors' noise."""
        return _models(self.pressure_time_s, self.motion_time_s, sample_time_s)

    def causal(self) -> KalmanFilter:
        """Build the Kalman filter of the same models: this smoother without its look-ahead."""
        return KalmanFilter(self)

    def smooth_force(self, force_n: Array, sample_time_s: float) -> Array:
        return _passes().smooth_states(self.models(sample_time_s)[0], force_n)[:, 0].copy()

    def motion(self, position_m: Array, sample_time_s: float) -> tuple[Array, Array]:
        states = _passes().smooth_states(self.models(sample_time_s)[1], position_m)
        return states[:, 1].copy(), states[:, 2].copy()

    def support(self, sample_time_s: float) -> Support:
        """Count the rows after which less than 1 % of a disturbance remains; strictly all rows have an influence."""
        rows = max(model.memory_rows() for model in self.models(sample_time_s))
        return Support(rows, rows)


@dataclass(frozen=True)
class KalmanFilter(CausalFilter):
    """The Kalman filter of an ``RtsSmoother``, with its steady gains."""

    smoother: RtsSmoother

    def block(self, sample_time_s: float) -> SteadyKalman:
        return _passes().SteadyKalman(*self.smoother.models(sample_time_s))

    def support(self, sample_time_s: float) -> Support:
        return Support(self.smoother.support(sample_time_s).before, 0)
