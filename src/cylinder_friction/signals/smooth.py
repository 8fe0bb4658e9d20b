"""What every filter of whole recordings gives, and how far it looks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

PRESSURE_1, PRESSURE_2, POSITION = 0, 1, 2
"""Columns of raw samples, shape ``(n, 3)``."""


@dataclass(frozen=True)
class SmoothSignals:
    """Smooth signals of one recording, each of shape ``(n,)``; extension positive.

    Attributes:
        pressure_1_smooth_pa: Piston side, gauge [Pa].
        pressure_2_smooth_pa: Rod side, gauge [Pa].
        velocity_m_s: [m/s].
        acceleration_m_s2: [m/s²].
    """

    pressure_1_smooth_pa: Array
    pressure_2_smooth_pa: Array
    velocity_m_s: Array
    acceleration_m_s2: Array

    def columns(self) -> dict[str, Array]:
        """Return the signals by name, as a recording's table takes them."""
        return dict(vars(self))


@dataclass(frozen=True)
class SmoothDrive:
    """Smooth signals of a recording with a drive force in place of pressures, each of shape ``(n,)``.

    Attributes:
        drive_force_smooth_n: Force on the rod, smoothed as pressures are, positive towards extension [N].
        velocity_m_s: [m/s].
        acceleration_m_s2: [m/s²].
    """

    drive_force_smooth_n: Array
    velocity_m_s: Array
    acceleration_m_s2: Array

    def columns(self) -> dict[str, Array]:
        """Return the signals by name, as a recording's table takes them."""
        return dict(vars(self))


@dataclass(frozen=True)
class Support:
    """Support of a filter in samples: output t depends on inputs ``t - before`` to ``t + after``."""

    before: int
    after: int


class SignalFilter(Protocol):
    """Smooths pressures and differentiates position, over a whole recording."""

    def smooth(self, samples: Array, sample_time_s: float) -> SmoothSignals:
        """Return the smooth signals of raw samples, shape ``(n, 3)``, taken every ``sample_time_s``."""

    def smooth_force(self, force_n: Array, sample_time_s: float) -> Array:
        """Return a force, shape ``(n,)``, smoothed as pressures are: neither later nor duller than they become."""

    def motion(self, position_m: Array, sample_time_s: float) -> tuple[Array, Array]:
        """Return velocity [m/s] and acceleration [m/s²] of a position, each of shape ``(n,)``, as ``smooth`` does."""

    def support(self, sample_time_s: float) -> Support:
        """Return the support of the filter, the longest of its four outputs."""
