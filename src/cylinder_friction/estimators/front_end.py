"""From raw samples to a network's features: causal linear filters, soft limit, history of motion, standardisation.

All features but the history come from one bank of finite-impulse-response filters on the raw inputs. The bank is
causal, holds little state, and is stored as plain numbers.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.linear import force_balance_taps, low_pass_balance_taps, refuse_missing_inputs
from cylinder_friction.realtime.history import HISTORY_NAMES, History, history_rows, new_history
from cylinder_friction.recordings.columns import LOAD_FORCE, SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.signals import causal

Design = Literal["force_balance", "paper", "full"]

CREEP_VELOCITY_M_S = 5e-3
"""Velocity at which the soft limit bends: below it lubrication is mixed and friction falls with velocity."""
SMOOTH_POSITION = "position_m_20"  # The feature from which the history of motion is computed


@dataclass(frozen=True, eq=False)
class FrontEnd:
    """Filters and scaling before the network."""

    inputs: tuple[str, ...]  # Columns of a recording, in the order of its samples
    names: tuple[str, ...]  # Names of the features, with units: the linear features, then the history's
    taps: Array  # Shape ``(linear features, inputs, lags)``, on raw samples
    limits: Array  # Shape ``(linear features,)``; where positive, the filtered value y becomes ``y / (|y| + limit)``
    mean: Array  # Shape ``(linear features,)``; subtracted before scaling
    scale: Array  # Shape ``(linear features,)``; divided by
    # Taps of the force [N] that the network corrects, shape ``(1, inputs, lags)``; None: the network gives all friction
    base_taps: Array | None = None
    history: History | None = None  # Features of the past motion, with their scaling; None: no such features
    sample_time_s: float = 1.0  # Sample time [s]; only the history depends on it

    @property
    def has_base(self) -> bool:
        """Whether there is a force balance to correct."""
        return self.base_taps is not None

    def step_fields(self) -> dict[str, Any]:
        """Give the front end's fields of a ``StepModel``."""
        base = np.zeros((len(self.inputs), 1)) if self.base_taps is None else self.base_taps[0]
        return {
            "feature_taps": np.ascontiguousarray(self.taps, dtype=np.float64),
            "feature_limits": self.limits,
            "feature_mean": self.mean,
            "feature_scale": self.scale,
            "base_taps": np.ascontiguousarray(base),
            "history": self.history,
        }

    def run(self, samples: Array) -> tuple[Any, Array]:
        """Compute standardised features, shape ``(n, features)``, float32, and the force to correct [N], ``(n,)``."""
        limits, history, filtered = self.limits, self.history, causal.FirFilter(self.taps).run(samples)
        soft = np.where(limits > 0.0, filtered / (np.abs(filtered) + np.where(limits > 0.0, limits, 1.0)), filtered)
        features = ((soft - self.mean) / self.scale).astype(np.float32)
        if history is not None:
            position_m = np.ascontiguousarray(filtered[:, history.position_feature])
            moved = history_rows(position_m, new_history(), history.settings(), self.sample_time_s)
            scaled = (moved - history.mean) / history.scale
            features = np.concatenate([features, scaled.astype(np.float32)], axis=1)
        if self.base_taps is None:
            return features, np.zeros(len(samples))
        return features, causal.FirFilter(self.base_taps).run(samples)[:, 0]

    def multiply_adds(self) -> int:
        history = 0 if self.history is None else 5 * len(HISTORY_NAMES)
        base = 0 if self.base_taps is None else np.count_nonzero(self.base_taps)
        return int(np.count_nonzero(self.taps) + base) + history

    def to_dict(self) -> dict[str, Any]:
        return {
            "inputs": list(self.inputs),
            "names": list(self.names),
            "taps": self.taps.tolist(),
            "limits": self.limits.tolist(),
            "mean": self.mean.tolist(),
            "scale": self.scale.tolist(),
            "base_taps": None if self.base_taps is None else self.base_taps.tolist(),
            "history": None if self.history is None else self.history.to_dict(),
            "sample_time_s": self.sample_time_s,
        }

    @classmethod
    def from_dict(cls, content: dict[str, Any]) -> Self:
        base, history = content["base_taps"], content.get("history")
        return cls(
            inputs=tuple(content.get("inputs", SAMPLE_COLUMNS)),
            names=tuple(content["names"]),
            base_taps=None if base is None else np.array(base),
            history=None if history is None else History.from_dict(history),
            sample_time_s=content.get("sample_time_s", 1.0),
            **{key: np.array(content[key]) for key in ("taps", "limits", "mean", "scale")},
        )


def fit_front_end(
    design: Design, cylinder: Cylinder, recordings: Sequence[Recording], inputs: Sequence[str] = SAMPLE_COLUMNS
) -> FrontEnd:
    """Fit a hybrid's front end: its scaling, and the smoothing of its force balance, on these recordings alone.

    Args:
        design: ``paper``: pressures, and any further input, through a moving average of 10 and velocity from
            differences of the averaged position, nothing to correct. ``force_balance``: the force balance and what
            moves it; the network corrects the force balance through a tuned low-pass. ``full``: all features that the
            inputs allow, the history of motion too. Without raw pressures ``force_balance`` equals ``full``, and there
            is no force balance to correct.
        cylinder: Its areas.
        recordings: Labelled recordings of one sample time.
        inputs: Columns of a sample; ``position_m`` must be one, both raw pressures too for ``paper``.

    Raises:
        ValueError: An input is missing.
    """
    inputs, sample_time_s = tuple(inputs), recordings[0].sample_time_s
    rows = _feature_rows(design, inputs, cylinder, sample_time_s)
    base = None
    if design != "paper" and _has_pressures(inputs):
        base = low_pass_balance_taps(cylinder, recordings, inputs)
    return standardised(with_history(unscaled_front_end(inputs, rows, base, sample_time_s)), recordings)


def feature_count(design: Design, inputs: Sequence[str] = SAMPLE_COLUMNS) -> int:
    """Count the features that a design gives its network."""
    rows = _feature_rows(design, tuple(inputs), None, 1.0)
    return len(rows) + (len(HISTORY_NAMES) if any(row.name == SMOOTH_POSITION for row in rows) else 0)


@dataclass(frozen=True)
class FeatureRow:
    """One feature: its name, taps of shape ``(inputs, lags)`` and soft limit (0 for none)."""

    name: str
    taps: Array
    limit: float = 0.0


def unscaled_front_end(
    inputs: tuple[str, ...], rows: Sequence[FeatureRow], base_taps: Array | None, sample_time_s: float
) -> FrontEnd:
    """Build a front end that neither centres nor scales these features."""
    length, count = max(row.taps.shape[1] for row in rows), len(rows)
    taps = np.stack([np.pad(row.taps, ((0, 0), (0, length - row.taps.shape[1]))) for row in rows])
    names, limits = tuple(row.name for row in rows), np.array([row.limit for row in rows])
    mean, scale = np.zeros(count), np.ones(count)
    return FrontEnd(inputs, names, taps, limits, mean, scale, base_taps, sample_time_s=sample_time_s)


def with_history(front_end: FrontEnd) -> FrontEnd:
    """Add the history of motion to an unscaled front end, if a smoothed position is among its features."""
    if SMOOTH_POSITION not in front_end.names:
        return front_end
    place, count = front_end.names.index(SMOOTH_POSITION), len(HISTORY_NAMES)
    history = History(place, np.zeros(count), np.ones(count))
    return replace(front_end, names=front_end.names + HISTORY_NAMES, history=history)


def standardised(front_end: FrontEnd, recordings: Sequence[Recording]) -> FrontEnd:
    """Set mean and scale of an unscaled front end from its features in usable rows.

    A feature that never varies gets the scale 1.
    """
    values = [front_end.run(each.samples(front_end.inputs))[0][each.usable()] for each in recordings]
    rows = np.concatenate([each.astype(np.float64) for each in values])
    mean, scale = rows.mean(axis=0), rows.std(axis=0)
    scale[scale == 0.0] = 1.0
    linear, history = len(front_end.taps), front_end.history
    if history is not None:
        count = len(history.mean)
        history = replace(history, mean=mean[linear:][:count], scale=scale[linear:][:count])
    return replace(front_end, mean=mean[:linear], scale=scale[:linear], history=history)


def _has_pressures(inputs: tuple[str, ...]) -> bool:
    return set(SAMPLE_COLUMNS) <= set(inputs)


def _feature_rows(
    design: Design, inputs: tuple[str, ...], cylinder: Cylinder | None, sample_time_s: float
) -> list[FeatureRow]:
    """List the linear features of a design. Without a cylinder the features have the right names and meaningless areas.

    Position gives velocity and creep, and in ``full`` also position and acceleration. Raw pressures give the force
    balance and its changes, a load its rate. Every other column (a temperature, a pressure level) gives its moving
    average of 20 samples.
    """
    if "position_m" not in inputs:
        raise ValueError(f"expected position_m among the inputs, but got {inputs}")
    raw = _has_pressures(inputs)
    full = design == "full" or (design == "force_balance" and not raw)

    def signal(column: str, taps: NDArray[np.float64]) -> Array:
        result = np.zeros((len(inputs), len(taps)))
        result[inputs.index(column)] = taps
        return result

    if design == "paper":
        refuse_missing_inputs(inputs)
        average = causal.moving_average_taps(10)
        velocity = causal.cascade_taps(average, causal.difference_taps(sample_time_s))
        return [
            FeatureRow("pressure_1_pa", signal("pressure_1_pa", average)),
            FeatureRow("pressure_2_pa", signal("pressure_2_pa", average)),
            FeatureRow("velocity_m_s", signal("position_m", velocity)),
            *(FeatureRow(name, signal(name, average)) for name in inputs if name not in SAMPLE_COLUMNS),
        ]
    rows = []
    if raw:
        areas = force_balance_taps(cylinder, inputs)[0] if cylinder is not None else np.ones((len(inputs), 1))
        pressure_rate = causal.one_sided_savitzky_golay_taps(15, 1, 1, sample_time_s)
        rows = [
            FeatureRow("force_balance_n", areas),
            FeatureRow("force_balance_4_n", areas * causal.moving_average_taps(4)),
            FeatureRow("force_balance_12_n", areas * causal.moving_average_taps(12)),
            FeatureRow("pressure_1_pa", signal("pressure_1_pa", causal.moving_average_taps(8))),
            FeatureRow("pressure_2_pa", signal("pressure_2_pa", causal.moving_average_taps(8))),
            FeatureRow("pressure_1_rate_pa_s", signal("pressure_1_pa", pressure_rate)),
        ]
    velocity = causal.one_sided_savitzky_golay_taps(21, 2, 1, sample_time_s)
    slow_velocity = causal.cascade_taps(causal.moving_average_taps(20), causal.difference_taps(sample_time_s))
    rows += [
        FeatureRow("velocity_m_s", signal("position_m", velocity)),
        FeatureRow("creep_velocity", signal("position_m", velocity), CREEP_VELOCITY_M_S),
        FeatureRow("slow_creep_velocity", signal("position_m", slow_velocity), CREEP_VELOCITY_M_S),
    ]
    if full:
        acceleration = causal.one_sided_savitzky_golay_taps(31, 2, 2, sample_time_s)
        rows.append(FeatureRow("acceleration_m_s2", signal("position_m", acceleration)))
    if raw and LOAD_FORCE in inputs:
        rows.append(FeatureRow("load_force_rate_n_s", signal(LOAD_FORCE, pressure_rate)))
    for name in inputs:
        if (name == "position_m" and full) or name not in SAMPLE_COLUMNS or (name != "position_m" and not raw):
            rows.append(FeatureRow(f"{name}_20", signal(name, causal.moving_average_taps(20))))
    return rows
