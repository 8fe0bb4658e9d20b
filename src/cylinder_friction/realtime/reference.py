"""The reference: one guarded real-time step in plain Python. It is the definition that every runtime must meet.

A step, in this order: guard, filters, network, forest, bounds. Filters, scaling and sums run in double precision, LSTM
and forest in single; every sum adds in the order in which the estimator's own ``advance`` does, so on sound samples the
two agree bit for bit.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import isfinite
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.realtime.bounds import next_regime
from cylinder_friction.realtime.flags import Estimate, Flag
from cylinder_friction.realtime.lstm import Lstm

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cylinder_friction.realtime.lstm import LstmState
    from cylinder_friction.realtime.model import Guard, StepModel

    Array = NDArray[np.float64]
    Single = NDArray[np.float32]

PRESSURES = (0, 1)
POSITION = 2


@dataclass
class GuardState:
    """What the guard remembers.

    Attributes:
        ready: A sample with three valid channels has come.
        held: The last valid value of each channel, shape ``(3,)``.
        constant_samples: For how many steps the position has been exactly constant.
        constant_from_m: Position at which each pressure last changed (or was invalid) [m].
        frozen: Whether each pressure is frozen.
        warming: Steps of warm-up left.
        recovering: Steps of recovery left.
    """

    ready: bool = False
    held: Array = field(default_factory=lambda: np.zeros(3))
    constant_samples: int = 0
    constant_from_m: list[float] = field(default_factory=lambda: [0.0, 0.0])
    frozen: list[bool] = field(default_factory=lambda: [False, False])
    warming: int = 0
    recovering: int = 0


class ReferenceStream:
    """One running estimate, guarded. Slow: for tests and for reading."""

    def __init__(self, model: StepModel) -> None:
        self.model = model
        self._network = None if model.network is None else Lstm(model.network)
        self._lags = max(taps.shape[-1] for taps in (model.feature_taps, model.base_taps, model.velocity_taps))
        self.reset()

    def reset(self) -> None:
        """Forget everything; the next step is a first step."""
        self._guard = GuardState()
        self._history = np.zeros((self._lags, 3))  # newest first
        self._lstm: LstmState | None = None if self._network is None else self._network.new_state()
        self._direction, self._reversal_left = 0, 0

    def warm_up(self, pressure_1_pa: float, pressure_2_pa: float, position_m: float, steps: int) -> None:
        """Reset, then takes ``steps`` steps on one and the same sample, so that the state comes to rest at it."""
        self.reset()
        for _ in range(steps):
            self.step(pressure_1_pa, pressure_2_pa, position_m)

    def step(self, pressure_1_pa: float, pressure_2_pa: float, position_m: float) -> Estimate:
        """Return the estimate at this sample, whatever the sample is."""
        raw = (float(pressure_1_pa), float(pressure_2_pa), float(position_m))
        invalid = [not _accepted(self.model.guard, channel, raw[channel]) for channel in range(3)]
        flags = sum(Flag.INVALID_PRESSURE_1 << channel for channel in range(3) if invalid[channel])
        if not self._guard.ready and any(invalid):
            return Estimate(0.0, 0.0, 0.0, int(Flag.NOT_READY | flags))
        first = not self._guard.ready
        if first:
            self._begin(raw)
        sample = [self._guard.held[channel] if invalid[channel] else raw[channel] for channel in range(3)]
        self._history = np.vstack([sample, self._history[:-1]])
        base_n = self._fir(self.model.base_taps)
        if self._outside(sample):
            flags |= Flag.OUTSIDE
        if self._frozen(sample, invalid, base_n):
            flags |= Flag.FROZEN
        self._guard.held[:] = sample
        flags |= self._trust(bad=any(invalid) or bool(flags & Flag.FROZEN))
        friction_n = self._friction(base_n)
        regime = self._regime()
        bounds = self.model.bounds
        return Estimate(
            friction_n, friction_n + bounds.lower_n[regime], friction_n + bounds.upper_n[regime], int(flags)
        )

    def _begin(self, sample: tuple[float, float, float]) -> None:
        """The first sound sample: as if it had always been there."""
        guard = self._guard
        guard.ready = True
        guard.held[:] = sample
        guard.constant_from_m = [sample[POSITION], sample[POSITION]]
        guard.warming = self.model.guard.warm_up_samples
        self._history[:] = sample

    def _outside(self, sample: list[float]) -> bool:
        guard = self.model.guard
        return any(not guard.trained_lower[c] <= sample[c] <= guard.trained_upper[c] for c in range(3))

    def _frozen(self, sample: list[float], invalid: list[bool], base_n: float) -> bool:
        """Follow how long each channel has been constant; a held value is not the sensor's and starts afresh."""
        guard, state = self.model.guard, self._guard
        for channel in PRESSURES:
            if invalid[channel] or sample[channel] != state.held[channel]:
                state.constant_from_m[channel] = sample[POSITION]
                state.frozen[channel] = False
            elif abs(sample[POSITION] - state.constant_from_m[channel]) > guard.freeze_travel_m:
                state.frozen[channel] = True
        if invalid[POSITION] or sample[POSITION] != state.held[POSITION]:
            state.constant_samples = 0
        else:
            state.constant_samples = min(state.constant_samples + 1, guard.freeze_samples + 1)
        stuck = state.constant_samples > guard.freeze_samples and abs(base_n) > guard.freeze_force_n
        return any(state.frozen) or stuck

    def _trust(self, bad: bool) -> Flag:
        """Count warm-up and recovery down, and returns which of the two this step is in."""
        state, flags = self._guard, Flag(0)
        if state.warming > 0:
            state.warming -= 1
            flags |= Flag.WARMING
        if bad:
            state.recovering = self.model.guard.recovery_samples
        elif state.recovering > 0:
            state.recovering -= 1
            flags |= Flag.RECOVERING
        return flags

    def _friction(self, base_n: float) -> float:
        model = self.model
        features = self._features()
        friction_n = base_n + model.target_mean_n
        hidden: Single = np.empty(0, dtype=np.float32)
        head = np.float32(0.0)
        if self._network is not None and self._lstm is not None:
            hidden_rows, heads = self._network.advance(self._lstm, features[None])
            hidden, head = hidden_rows[0], heads[0]
        if model.head_counts:
            friction_n += model.target_scale_n * float(head)
        if model.forest is not None:
            seen: dict[str, list[Single]] = {
                "hidden": [hidden],
                "hidden_head_features": [hidden, np.array([head]), features],
                "features": [features],
            }
            row = np.concatenate(seen[model.forest_sees])
            friction_n += model.target_scale_n * float(model.forest.predict(row[None])[0])
        return friction_n

    def _features(self) -> Single:
        model = self.model
        result = np.empty(len(model.feature_taps), dtype=np.float32)
        for feature, taps in enumerate(model.feature_taps):
            value, limit = self._fir(taps), model.feature_limits[feature]
            if limit > 0.0:
                value = value / (abs(value) + limit)
            result[feature] = (value - model.feature_mean[feature]) / model.feature_scale[feature]
        return result

    def _fir(self, taps: Array) -> float:
        """Return ``sum over i, l of taps[i, l] * u[t - l, i]``, lag after lag, channel after channel."""
        total = 0.0
        for channel in range(3):
            for lag, tap in enumerate(taps[channel]):
                if tap != 0.0:
                    total += float(tap * self._history[lag, channel])
        return total

    def _regime(self) -> int:
        bounds = self.model.bounds
        regime, self._direction, self._reversal_left = next_regime(
            self._fir(self.model.velocity_taps),
            self._direction,
            self._reversal_left,
            bounds.standstill_m_s,
            bounds.creep_m_s,
            bounds.reversal_samples,
        )
        return int(regime)


def _accepted(guard: Guard, channel: int, value: float) -> bool:
    return isfinite(value) and guard.accept_lower[channel] <= value <= guard.accept_upper[channel]
