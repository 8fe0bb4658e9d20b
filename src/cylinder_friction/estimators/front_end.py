"""From raw samples to what a network sees: causal linear filters, a soft limit, standardisation.

Everything a hybrid does before its network is one bank of finite-impulse-response filters on the three raw signals,
so it is causal, holds little state, and is stored as plain numbers.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, Protocol, Self

import numpy as np

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.linear import force_balance_taps, labelled_rows
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.signals.causal import (
    FirFilter,
    FirState,
    cascade_taps,
    difference_taps,
    moving_average_taps,
    one_sided_savitzky_golay_taps,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from cylinder_friction.estimators.base import Array
    from cylinder_friction.recordings.recording import Recording

Design = Literal["force_balance", "paper"]

SMOOTHING_LAGS = 16
CREEP_VELOCITY_M_S = 5e-3
"""Velocity at which the soft limit bends: below it lubrication is mixed and friction falls with velocity."""


@dataclass(frozen=True)
class FrontEnd:
    """Filters and scaling before the network.

    Attributes:
        names: What each feature is, with its unit.
        taps: Shape ``(features, inputs, lags)``, on raw samples.
        limits: Shape ``(features,)``; where positive, the filtered value y becomes ``y / (|y| + limit)``.
        mean: Shape ``(features,)``; taken off before scaling.
        scale: Shape ``(features,)``; divided by.
        base_taps: Shape ``(1, inputs, lags)``; the force [N] that the network corrects; None: it starts from 0.
    """

    names: tuple[str, ...]
    taps: Array
    limits: Array
    mean: Array
    scale: Array
    base_taps: Array | None

    def to_dict(self) -> dict[str, Any]:
        return {
            "names": list(self.names),
            "taps": self.taps.tolist(),
            "limits": self.limits.tolist(),
            "mean": self.mean.tolist(),
            "scale": self.scale.tolist(),
            "base_taps": None if self.base_taps is None else self.base_taps.tolist(),
        }

    @classmethod
    def from_dict(cls, content: dict[str, Any]) -> Self:
        arrays = {key: np.array(content[key]) for key in ("taps", "limits", "mean", "scale")}
        base = content["base_taps"]
        return cls(names=tuple(content["names"]), base_taps=None if base is None else np.array(base), **arrays)


@dataclass
class FrontEndState:
    """State of the feature filters and of the force that is corrected."""

    features: FirState
    base: FirState


class FrontEndBlock:
    """Runs a ``FrontEnd`` over samples."""

    def __init__(self, front_end: FrontEnd) -> None:
        self.front_end = front_end
        self._features = FirFilter(front_end.taps)
        self._base = FirFilter(
            np.zeros((1, front_end.taps.shape[1], 1)) if front_end.base_taps is None else front_end.base_taps
        )

    def new_state(self) -> FrontEndState:
        return FrontEndState(self._features.new_state(), self._base.new_state())

    def advance(self, state: FrontEndState, samples: Array) -> tuple[Any, Array]:
        """Return standardised features, shape ``(n, features)``, float32, and the force to correct [N], ``(n,)``."""
        limits = self.front_end.limits
        filtered = self._features.advance(state.features, samples)
        soft = np.where(limits > 0.0, filtered / (np.abs(filtered) + np.where(limits > 0.0, limits, 1.0)), filtered)
        scaled = (soft - self.front_end.mean) / self.front_end.scale
        return scaled.astype(np.float32), self._base.advance(state.base, samples)[:, 0]

    def multiply_adds(self) -> int:
        return int(np.count_nonzero(self._features.taps) + np.count_nonzero(self._base.taps))


class FeatureMaker(Protocol):
    """What turns samples into features: a ``FrontEndBlock``, or one that adds features to it."""

    def new_state(self) -> Any:
        """Return the state before the first sample."""

    def advance(self, state: Any, samples: Array) -> tuple[Any, Array]:
        """Return features, shape ``(n, k)``, and the force to correct [N], shape ``(n,)``; changes ``state``."""


def fit_front_end(design: Design, cylinder: Cylinder, recordings: Sequence[Recording]) -> FrontEnd:
    """Return the front end of a hybrid, its scaling (and the smoothing of its base) learnt on these recordings alone.

    Args:
        design: ``paper``: pressures through a moving average of 10 and velocity from differences of the averaged
            position, nothing to correct. ``force_balance``: the force balance and what moves it, correcting the
            least-squares smoothed force balance.
        cylinder: Its areas.
        recordings: Labelled recordings of one sample time.
    """
    sample_time_s = recordings[0].sample_time_s
    rows = _paper_rows(sample_time_s) if design == "paper" else _force_balance_rows(cylinder, sample_time_s)
    base = None if design == "paper" else smoothed_force_balance_taps(cylinder, recordings)
    raw = unscaled_front_end(rows, base)
    mean, scale = standardisation(FrontEndBlock(raw), SAMPLE_COLUMNS, recordings)
    return replace(raw, mean=mean, scale=scale)


def unscaled_front_end(rows: Sequence[FeatureRow], base_taps: Array | None) -> FrontEnd:
    """Return a front end that neither centres nor scales these features."""
    taps, limits = _stack([row.taps for row in rows]), np.array([row.limit for row in rows])
    names, count = tuple(row.name for row in rows), len(rows)
    return FrontEnd(names, taps, limits, np.zeros(count), np.ones(count), base_taps)


def standardisation(block: FeatureMaker, inputs: Sequence[str], recordings: Sequence[Recording]) -> tuple[Array, Array]:
    """Return mean and standard deviation of each feature over the usable rows; 1 for one that never varies."""
    seen = [
        block.advance(block.new_state(), recording.samples(inputs))[0][recording.usable()].astype(np.float64)
        for recording in recordings
    ]
    values = np.concatenate(seen)
    mean, scale = values.mean(axis=0), values.std(axis=0)
    scale[scale == 0.0] = 1.0
    return mean, scale


def smoothed_force_balance_taps(cylinder: Cylinder, recordings: Sequence[Recording]) -> Array:
    """Return the taps, shape ``(1, 3, lags)``, of the causally smoothed force balance nearest to the labels.

    Least squares on the last ``SMOOTHING_LAGS`` values of P1·A1 - P2·A2 (a finite Wiener filter; Wiener 1949).
    """
    labels, masks = labelled_rows(recordings)
    balance = FirFilter(force_balance_taps(cylinder))
    lags = FirFilter(np.eye(SMOOTHING_LAGS)[:, None, :])
    rows = []
    for recording, mask in zip(recordings, masks, strict=True):
        force = balance.advance(balance.new_state(), recording.samples())
        rows.append(lags.advance(lags.new_state(), force)[mask])
    lagged = np.concatenate(rows)
    weights = np.linalg.lstsq(lagged.T @ lagged, lagged.T @ labels, rcond=None)[0]
    return force_balance_taps(cylinder) * weights[None, None, :]


def feature_count(design: Design) -> int:
    """Return how many features a design gives its network."""
    if design == "paper":
        return len(_paper_rows(1.0))
    return len(
        _force_balance_rows(
            Cylinder(name="any", bore_diameter_m=2.0, rod_diameter_m=1.0, stroke_m=1.0, moving_mass_kg=1.0), 1.0
        )
    )


@dataclass(frozen=True)
class FeatureRow:
    """One feature: its name, taps of shape ``(inputs, lags)`` and soft limit (0 for none)."""

    name: str
    taps: Array
    limit: float = 0.0


def feature_rows(inputs: Sequence[str], cylinder: Cylinder, sample_time_s: float) -> list[FeatureRow]:
    """Return the linear features of any set of inputs.

    Position gives itself, velocity, creep and acceleration; raw pressures, which then come first, what the default
    hybrid sees of them; every other column (a temperature, a pressure level) its moving average of 20.
    """
    rows = []
    if tuple(inputs[:3]) == SAMPLE_COLUMNS:
        pad = ((0, len(inputs) - 3), (0, 0))
        rows = [replace(row, taps=np.pad(row.taps, pad)) for row in _force_balance_rows(cylinder, sample_time_s)]
    place, count = inputs.index("position_m"), len(inputs)
    if not rows:
        velocity = one_sided_savitzky_golay_taps(21, 2, 1, sample_time_s)
        slow_velocity = cascade_taps(moving_average_taps(20), difference_taps(sample_time_s))
        rows = [
            FeatureRow("velocity_m_s", _signal(place, velocity, count)),
            FeatureRow("creep_velocity", _signal(place, velocity, count), CREEP_VELOCITY_M_S),
            FeatureRow("slow_creep_velocity", _signal(place, slow_velocity, count), CREEP_VELOCITY_M_S),
        ]
    acceleration = one_sided_savitzky_golay_taps(31, 2, 2, sample_time_s)
    rows.append(FeatureRow("acceleration_m_s2", _signal(place, acceleration, count)))
    known = SAMPLE_COLUMNS if tuple(inputs[:3]) == SAMPLE_COLUMNS else ()
    for column, name in enumerate(inputs):
        if name not in known or name == "position_m":
            rows.append(FeatureRow(f"{name}_20", _signal(column, moving_average_taps(20), count)))
    return rows


def _signal(column: int, taps: Array, inputs: int = 3) -> Array:
    result = np.zeros((inputs, len(taps)))
    result[column] = taps
    return result


def _paper_rows(sample_time_s: float) -> list[FeatureRow]:
    average = moving_average_taps(10)
    velocity = cascade_taps(average, difference_taps(sample_time_s))
    return [
        FeatureRow("pressure_1_pa", _signal(0, average)),
        FeatureRow("pressure_2_pa", _signal(1, average)),
        FeatureRow("velocity_m_s", _signal(2, velocity)),
    ]


def _force_balance_rows(cylinder: Cylinder, sample_time_s: float) -> list[FeatureRow]:
    areas = force_balance_taps(cylinder)[0, :, 0]
    velocity = one_sided_savitzky_golay_taps(21, 2, 1, sample_time_s)
    slow_velocity = cascade_taps(moving_average_taps(20), difference_taps(sample_time_s))
    pressure_rate = one_sided_savitzky_golay_taps(15, 1, 1, sample_time_s)
    return [
        FeatureRow("force_balance_n", areas[:, None] * np.ones((1, 1))),
        FeatureRow("force_balance_4_n", areas[:, None] * moving_average_taps(4)),
        FeatureRow("force_balance_12_n", areas[:, None] * moving_average_taps(12)),
        FeatureRow("pressure_1_pa", _signal(0, moving_average_taps(8))),
        FeatureRow("pressure_2_pa", _signal(1, moving_average_taps(8))),
        FeatureRow("pressure_1_rate_pa_s", _signal(0, pressure_rate)),
        FeatureRow("velocity_m_s", _signal(2, velocity)),
        FeatureRow("creep_velocity", _signal(2, velocity), CREEP_VELOCITY_M_S),
        FeatureRow("slow_creep_velocity", _signal(2, slow_velocity), CREEP_VELOCITY_M_S),
    ]


def _stack(rows: list[Array]) -> Array:
    length = max(row.shape[1] for row in rows)
    return np.stack([np.pad(row, ((0, 0), (0, length - row.shape[1]))) for row in rows])
