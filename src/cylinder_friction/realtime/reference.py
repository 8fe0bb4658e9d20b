"""The reference: one guarded real-time step in plain Python. It is the definition that every runtime must meet.

A step, in this order: guard, filters, history, network, forest, bounds. Filters, scaling and sums run in double
precision, LSTM and forest in single; every sum adds in the order in which the estimator's own ``advance`` does, so on
valid samples the two agree bit for bit.
"""

from dataclasses import dataclass, field
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.realtime.bounds import next_regime
from cylinder_friction.realtime.flags import Estimate, Flag, invalid_flag
from cylinder_friction.realtime.history import history_step, new_history
from cylinder_friction.realtime.lstm import Lstm, LstmState
from cylinder_friction.realtime.model import Guard, StepModel
from cylinder_friction.realtime.position_load import load_at
from cylinder_friction.realtime.sensor_offset import DEVIATION, EXTENDED, OFFSET, RETRACTED, offset_step
from cylinder_friction.realtime.unmodelled_force import force_limits, unmodelled_force

Single = NDArray[np.float32]


@dataclass
class GuardState:
    """State of the guard."""

    ready: bool = False  # A sample with all inputs valid has come
    held: Array = field(default_factory=lambda: np.zeros(0))  # The last valid value of each input, shape ``(inputs,)``
    constant_samples: int = 0  # For how many steps the position has been exactly constant
    # Position at which each raw pressure last changed (or was invalid) [m], by its place
    constant_from_m: dict[int, float] = field(default_factory=dict)
    frozen: set[int] = field(default_factory=set)  # Places of the raw pressures that are frozen
    warming: int = 0  # Steps of warm-up left
    recovering: int = 0  # Steps of recovery left
    unmodelled: int = 0  # Steps of motion left after which an unmodelled force no longer counts


class ReferenceStream:
    """One running estimate, guarded. Slow: for tests and for reading."""

    def __init__(self, model: StepModel) -> None:
        self.model = model
        self._network = None if model.network is None else Lstm(model.network)
        self._load = None if model.position_load is None else model.position_load.packed()
        self._force_limits = force_limits(model)
        self._lags = max(taps.shape[-1] for taps in (model.feature_taps, model.base_taps, model.velocity_taps))
        self.reset()

    def reset(self, offset_n: float = 0.0, uncertainty_n: float | None = None) -> None:
        """Forget everything; the next step is a first step, from this offset of the sensors; see ``RealTimeStream``."""
        tracker = self.model.offset
        self._offset = np.zeros(OFFSET + 2) if tracker is None else tracker.new_state(offset_n, uncertainty_n)
        self._guard = GuardState()
        self._samples = np.zeros((self._lags, len(self.model.channels)))  # newest first
        self._motion = new_history()
        self._lstm: LstmState | None = None if self._network is None else self._network.new_state()
        self._direction, self._reversal_left = 0, 0

    def warm_up(self, *sample: float, steps: int) -> None:
        """Reset, then take ``steps`` steps on one and the same sample, so that the state comes to rest at it."""
        self.reset()
        for _ in range(steps):
            self.step(*sample)

    def step(self, *sample: float) -> Estimate:
        """Return the estimate at this sample, one number per input, whatever the sample is."""
        raw = np.array(sample, dtype=np.float64)
        invalid = [not _accepted(self.model.guard, place, value) for place, value in enumerate(raw)]
        flags = 0
        for name, bad in zip(self.model.inputs, invalid, strict=True):
            flags |= invalid_flag(name) if bad else 0
        if not self._guard.ready and any(invalid):
            return Estimate(0.0, 0.0, 0.0, int(Flag.NOT_READY | flags))
        if not self._guard.ready:
            self._begin(raw)
        now = np.where(invalid, self._guard.held, raw)
        channels = self._channels(now)
        self._samples = np.vstack([channels, self._samples[:-1]])
        base_n = self._fir(self.model.base_taps)
        if self._outside(now):
            flags |= Flag.OUTSIDE
        if self._frozen(now, invalid, base_n):
            flags |= Flag.FROZEN
        self._guard.held = now
        flags |= self._trust(bad=any(invalid) or bool(flags & Flag.FROZEN))
        friction_n = self._friction(base_n)
        regime = self._regime()
        flags |= self._offset_flag()
        further = self._further(regime)
        flags |= self._unmodelled_force(channels, regime)
        self._learn_offset(channels, valid=not any(invalid) and not flags & (Flag.FROZEN | Flag.UNMODELLED_FORCE))
        bounds = self.model.bounds
        lower_n, upper_n = friction_n + further * bounds.lower_n[regime], friction_n + further * bounds.upper_n[regime]
        return Estimate(friction_n, lower_n, upper_n, int(flags))

    def _begin(self, sample: Array) -> None:
        """Begin with the first valid sample: as if it had always been there."""
        guard = self._guard
        guard.ready = True
        guard.held = sample
        guard.constant_from_m = dict.fromkeys(self.model.pressures, float(sample[self.model.position]))
        guard.warming = self.model.guard.warm_up_samples
        self._samples[:] = self._channels(sample)

    def _channels(self, sample: Array) -> Array:
        """Return the sample with the load that position decides, where the model has one."""
        if self._load is None:
            return sample
        return np.append(sample, load_at(self._load, float(sample[self.model.position])))

    def _outside(self, now: Array) -> bool:
        guard = self.model.guard
        return bool(((now < guard.trained_lower) | (now > guard.trained_upper)).any())

    def _frozen(self, now: Array, invalid: list[bool], base_n: float) -> bool:
        """Follow how long each input has been constant; a held value is not the sensor's and starts afresh."""
        guard, state, place = self.model.guard, self._guard, self.model.position
        for pressure in self.model.pressures:
            if invalid[pressure] or now[pressure] != state.held[pressure]:
                state.constant_from_m[pressure] = float(now[place])
                state.frozen.discard(pressure)
            elif abs(now[place] - state.constant_from_m[pressure]) > guard.freeze_travel_m:
                state.frozen.add(pressure)
        if invalid[place] or now[place] != state.held[place]:
            state.constant_samples = 0
        else:
            state.constant_samples = min(state.constant_samples + 1, guard.freeze_samples + 1)
        stuck = state.constant_samples > guard.freeze_samples and abs(base_n) > guard.freeze_force_n
        return bool(state.frozen) or stuck

    def _trust(self, bad: bool) -> int:
        """Count warm-up and recovery down; return the flags of those that this step is in."""
        state, flags = self._guard, 0
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
        result = []
        for feature, taps in enumerate(model.feature_taps):
            value, limit = self._fir(taps), model.feature_limits[feature]
            if limit > 0.0:
                value = value / (abs(value) + limit)
            result.append((value - model.feature_mean[feature]) / model.feature_scale[feature])
        if (history := model.history) is not None:
            moved = np.empty(len(history.mean))
            smooth_m = self._fir(model.feature_taps[history.position_feature])
            history_step(smooth_m, self._motion, history.settings(), model.sample_time_s, moved)
            result.extend((moved - history.mean) / history.scale)
        return np.array(result, dtype=np.float32)

    def _fir(self, taps: Array) -> float:
        """Return ``sum over i, l of taps[i, l] * u[t - l, i]``, lag after lag, input after input."""
        total = 0.0
        for channel, row in enumerate(taps):
            for lag, tap in enumerate(row):
                if tap != 0.0:
                    total += float(tap * self._samples[lag, channel])
        if self.model.offset is not None:
            total -= float(self._offset[OFFSET] * self.model.offset.zero_of(taps[None])[0])
        return total

    def _offset_flag(self) -> int:
        """Return the flag of an offset that has not been learned yet."""
        unknown = self.model.offset is not None and self._offset[EXTENDED] * self._offset[RETRACTED] == 0.0
        return Flag.OFFSET_UNKNOWN if unknown else 0

    def _unmodelled_force(self, channels: Array, regime: int) -> int:
        """Return the flag of a force balance beyond the range of training."""
        limits, guard, stated = self._force_limits, self._guard, self.model.guard
        if not limits.size:
            return 0
        found, guard.unmodelled = unmodelled_force(
            limits,
            channels,
            regime,
            self._direction,
            guard.unmodelled,
            stated.clear_samples,
            stated.least_pressure_pa,
        )
        return Flag.UNMODELLED_FORCE if found else 0

    def _further(self, regime: int) -> float:
        """Return how many times as far the bounds are as with a known offset."""
        spread_n = self.model.bounds.spread_n[regime]
        if self.model.offset is None or spread_n <= 0.0:
            return 1.0
        ratio = self._offset[DEVIATION] / spread_n
        return float(np.sqrt(1.0 + ratio * ratio))  # a power may round otherwise

    def _learn_offset(self, channels: Array, *, valid: bool) -> None:
        """Let this sample correct the next ones."""
        if self.model.offset is not None:
            velocity_m_s = self._fir(self.model.velocity_taps)
            place = self.model.position
            offset_step(*self.model.offset.constants(), self._offset, place, velocity_m_s, channels, valid)

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
