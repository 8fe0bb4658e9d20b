"""LuGre sample by sample in numpy, as one would write it from the equations."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.signals.causal import one_sided_savitzky_golay_taps

if TYPE_CHECKING:
    from cylinder_friction.estimators.lugre import LugreEstimator


class LugreInNumpy:
    """Velocity from position through the play (see ``MotionSense``), then the exact step of ``friction_models``.

    Args:
        estimator: A fitted LuGre, with or without pressure scaling.
    """

    def __init__(self, estimator: LugreEstimator) -> None:
        assert estimator.parameters is not None
        assert estimator.sense is not None
        assert estimator.sample_time_s is not None
        self._law, self._sense, self._time_s = estimator.parameters, estimator.sense, estimator.sample_time_s
        self._scaled = estimator.pressure_scaled
        window, order = self._sense.window, self._sense.order
        rows = [one_sided_savitzky_golay_taps(window, order, derivative, self._time_s) for derivative in (0, 1)]
        self._taps = np.stack(rows)
        self._history: np.ndarray[tuple[int, ...], np.dtype[np.float64]] | None = None
        self._centre_m, self._push, self._pushed = 0.0, 0.0, 0
        self._bristle_m = 0.0

    def step(self, pressure_1_pa: float, pressure_2_pa: float, position_m: float) -> float:
        """Return friction [N]."""
        law = self._law
        velocity = self._velocity(position_m)
        if velocity == 0.0:
            return law.bristle_stiffness_n_m * self._bristle_m
        speed = np.abs(velocity)
        falling = np.exp(-((speed / law.stribeck_velocity_m_s) ** law.stribeck_exponent))
        dry = law.coulomb_n + (law.static_n - law.coulomb_n) * falling
        if self._scaled:
            dry *= 1.0 + law.pressure_slope_n_pa * np.maximum(pressure_1_pa + pressure_2_pa, 0.0) / law.coulomb_n
        if velocity < 0.0:
            dry *= law.retract_ratio
        decay = law.bristle_stiffness_n_m * speed * self._time_s / dry
        steady_m = np.sign(velocity) * dry / law.bristle_stiffness_n_m
        after = self._bristle_m * np.exp(-decay) - np.expm1(-decay) * steady_m
        rate = (after - self._bristle_m) / self._time_s
        damping = law.bristle_damping_n_s_m * np.exp(-((velocity / law.damping_velocity_m_s) ** 2))
        self._bristle_m = after
        return float(law.bristle_stiffness_n_m * after + damping * rate + law.viscous_n_s_m * velocity)

    def _velocity(self, position_m: float) -> float:
        sense = self._sense
        first = self._history is None
        if self._history is None:
            self._history = np.full(sense.window, position_m)
        self._history[1:] = self._history[:-1]
        self._history[0] = position_m
        smooth, rate = self._taps @ self._history
        if first:
            self._centre_m = smooth
        if smooth > self._centre_m + sense.play_m:
            self._centre_m, self._push, self._pushed = smooth - sense.play_m, 1.0, sense.window
        elif smooth < self._centre_m - sense.play_m:
            self._centre_m, self._push, self._pushed = smooth + sense.play_m, -1.0, sense.window
        elif self._pushed > 0:
            self._pushed -= 1
        lets_through = sense.play_m == 0.0 or (self._pushed > 0 and rate * self._push > 0.0)
        return float(rate) if np.abs(rate) >= sense.dead_band_m_s and lets_through else 0.0
