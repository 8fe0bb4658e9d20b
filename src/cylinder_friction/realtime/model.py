"""The complete description of an estimator's step, as plain arrays; every runtime is built from it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, Self, TypeVar

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.realtime.position_load import PositionLoad, channel_names
from cylinder_friction.realtime.sensor_offset import OffsetTracker
from cylinder_friction.realtime.trained_for import TrainedFor
from cylinder_friction.recordings.channel_correction import ChannelCorrection
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.line_loss import LineLoss

if TYPE_CHECKING:
    from cylinder_friction.realtime.forest import Forest
    from cylinder_friction.realtime.history import History
    from cylinder_friction.realtime.lstm import LstmWeights


ForestSees = Literal["nothing", "hidden", "hidden_head_features", "features"]


@dataclass(frozen=True)
class Guard:
    """Limits that a sample must meet, and how long a step is flagged after a sample that does not.

    ``FrictionEstimator.calibrate`` derives it from the training recordings. A step never lets an invalid value into its
    state: it holds the last valid one and sets a flag. Numbers are in the unit of their input, one per input.
    """

    # Limits of a working sensor's readings; one number per input
    accept_lower: tuple[float, ...]
    accept_upper: tuple[float, ...]
    # Limits of training; a value outside is estimated and flagged as an extrapolation
    trained_lower: tuple[float, ...]
    trained_upper: tuple[float, ...]
    freeze_travel_m: float  # A pressure that stays exactly constant over more travel than this is frozen [m]
    freeze_samples: int  # A position that stays exactly constant longer is frozen, if friction cannot hold the force
    freeze_force_n: float  # Largest force that friction can hold at rest [N]
    warm_up_samples: int  # Steps after a reset that are flagged ``WARMING``
    recovery_samples: int  # Steps after the last bad sample that are flagged ``RECOVERING``
    # Range of the force balance (see ``realtime.unmodelled_force``): its change per unit of each channel [N], then
    # lines over the sum of both pressures, constant [N] and slope [N/Pa]; empty if the range is unknown
    force_weights: tuple[float, ...] = ()
    sliding_lower: tuple[float, ...] = ()  # Limit of the balance along the motion
    sliding_upper: tuple[float, ...] = ()
    largest_force: tuple[float, ...] = ()  # Limit of its size while the piston does not slide
    clear_samples: int = 0  # Samples of motion within the range of sliding that refute an unmodelled force
    least_pressure_pa: float = -1e12  # Least sum of both pressures of a working cylinder [Pa]


@dataclass(frozen=True)
class Bounds:
    """An interval for friction around an estimate, by regime of motion (see ``realtime.bounds``).

    The regimes are standstill, creep, sliding, and the moments just after a reversal or start. The bounds hold with the
    stated ``probability`` over sessions like those of the calibration, not within every single session.
    """

    lower_n: tuple[float, ...]  # Added to the estimate [N], one per regime, shape ``(4,)``
    upper_n: tuple[float, ...]  # The same for the upper bound [N]
    standstill_m_s: float  # Velocity below which the piston stands still [m/s]
    creep_m_s: float  # Velocity below which it creeps [m/s]; equal to ``standstill_m_s`` if unknown
    reversal_samples: int  # Duration of a reversal or start
    # Probability of lying between the bounds, over sessions and samples like those of the calibration
    probability: float
    # ``friction``: the sensors' stated uncertainty is part of the bounds; ``label``: it is not known, and a sensor's
    # offset, which shifts label and estimate alike, is not covered
    holds: Literal["friction", "label"] = "label"
    # Standard deviation of the errors with the sensors' offset known, one per regime [N]: with an offset as uncertain
    # as s, bounds are √(1 + (s/spread)²) times as far away; 0 if the step learns no offset, and they never change
    spread_n: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)

    def in_words(self) -> str:
        """State what lies between the bounds, and under which assumption; pages and messages show this sentence."""
        if self.probability == 1.0:
            return "as wide as can be, as this model's errors were never calibrated"
        sessions = "over sessions like those of the calibration, with pressures as quiet"
        often = f"with probability {self.probability:g} {sessions}"
        if self.holds == "friction":
            return f"they hold friction {often}, if the sensors are as accurate as stated for the calibration"
        return f"they hold the label {often}; friction only if zeros are right, of which nothing was stated"


GuardOrBounds = TypeVar("GuardOrBounds", Guard, Bounds)


def from_json(kind: type[GuardOrBounds], values: dict[str, Any] | None) -> GuardOrBounds | None:
    """Rebuild a guard or bounds from JSON, which has lists in place of tuples; None for None.

    Use it to read a description of your own; ``load`` does this for a saved estimator. Unknown or missing keys raise
    ``TypeError``. The numbers themselves are checked later, by ``check_step_model``.
    """
    if values is None:
        return None
    known: dict[str, Any] = {key: tuple(value) if isinstance(value, list) else value for key, value in values.items()}
    return kind(**known)


def applied(
    inputs: Sequence[str], corrections: Mapping[str, ChannelCorrection], line_loss: Mapping[str, LineLoss]
) -> list[str]:
    """State as formulas what a step makes of the readings of its inputs, if it does not take them as they are."""
    formulas = []
    for name in inputs:
        if name in corrections or name in line_loss:
            lost = f" - loss of its line ({line_loss[name].in_words()})" if name in line_loss else ""
            formulas.append(corrections.get(name, ChannelCorrection()).formula(name) + lost)
    return formulas


@dataclass(frozen=True)
class StepModel:
    """One estimator, ready for any runtime: filters, network, forest, guard and bounds as plain arrays.

    ``FrictionEstimator.step_model`` makes it. Pass it to ``RealTimeStream``, to ``export_c`` or ``export_fmu``, or to a
    runtime of your own; all give the same numbers. Forces are in newtons, friction is positive when it opposes
    velocity.

    A step takes readings as the sensors give them, in SI units, pressures gauge. It applies ``corrections`` first, and
    the guard checks corrected samples. Then it subtracts ``line_loss`` at the causal velocity; filters, force balance
    and offset see the pressures in the chambers. A recording's columns are corrected already, but lines still lose
    pressure there: give them to ``for_recordings()``, or give ``Recording.readings`` to this one.
    """

    sample_time_s: float  # Sample time [s]; an LSTM is valid at this one only
    feature_taps: Array  # FIR filters on raw samples, shape ``(features, channels, lags)``
    feature_limits: Array  # If positive, a filtered value y becomes ``y / (|y| + limit)``, shape ``(features,)``
    # Subtracted, then divided by, shape ``(features,)``
    feature_mean: Array
    feature_scale: Array
    base_taps: Array  # The force that is corrected [N], shape ``(channels, lags)``; zeros if there is none
    velocity_taps: Array  # The causal velocity that decides the regime [m/s], shape ``(channels, lags)``
    network: LstmWeights | None  # None for a model without LSTM
    forest: Forest | None  # None for a model without forest
    forest_sees: ForestSees  # Which inputs the forest takes, in this order: hidden state, head, features
    head_counts: bool  # Whether the network's head is part of the estimate
    # Force that the outputs of network and forest stand for [N]
    target_mean_n: float
    target_scale_n: float
    guard: Guard  # Limits of valid samples
    bounds: Bounds  # The interval around the estimate
    # Columns of a recording that make up a sample, in this order; ``position_m`` is one
    inputs: tuple[str, ...] = SAMPLE_COLUMNS
    # Features of the motion so far, which follow the linear ones; None for a model without
    history: History | None = None
    # Tracker of the sensors' offset; None: no offset is learned, and it stays in the estimate
    offset: OffsetTracker | None = None
    # The load that position decides, a channel beside the inputs; None: it is an input, or there is none
    position_load: PositionLoad | None = None
    lag_s: float = 0.0  # Delay of a step's friction and bounds behind its sample [s]
    trained_for: TrainedFor | None = None  # The cylinder, noise and friction it fits; None: not known
    # Sign and offset of the inputs that have either, which the step applies to each sample first
    corrections: Mapping[str, ChannelCorrection] = field(default_factory=dict)
    # Loss of the lines between pressure sensors and chambers, which the step subtracts before its filters
    line_loss: Mapping[str, LineLoss] = field(default_factory=dict)

    def for_recordings(self) -> Self:
        """Copy the model without its corrections, for samples of recordings, which ingest has corrected."""
        return replace(self, corrections={})

    def applied(self) -> str:
        """State what the step makes of the sensors' readings first, in formulas; empty if it takes them as they are."""
        return ", ".join(applied(self.inputs, self.corrections, self.line_loss))

    @property
    def input_corrections(self) -> tuple[ChannelCorrection, ...]:
        """The correction of each input, in their order."""
        return tuple(self.corrections.get(name, ChannelCorrection()) for name in self.inputs)

    @property
    def trained_readings(self) -> tuple[Array, Array]:
        """Lower and upper end of the readings that are no extrapolation, one number per input."""
        ends = np.array([self.guard.trained_lower, self.guard.trained_upper])
        readings = [own.readings(values) for own, values in zip(self.input_corrections, ends.T, strict=True)]
        lower, upper = np.sort(np.stack(readings, axis=1), axis=0)
        return lower, upper

    @cached_property
    def channels(self) -> tuple[str, ...]:
        """Channels of the filters: the inputs, and a load that position decides."""
        return channel_names(self.inputs, self.position_load)

    @cached_property
    def position(self) -> int:
        """Place of the position among the inputs."""
        return self.inputs.index("position_m")

    @cached_property
    def pressures(self) -> tuple[int, ...]:
        """Places of the raw pressures among the inputs; these cannot stay constant over a travel."""
        return tuple(self.inputs.index(name) for name in SAMPLE_COLUMNS[:2] if name in self.inputs)

    @property
    def feature_count(self) -> int:
        """Number of features that network and forest take, history included."""
        return len(self.feature_taps) + (0 if self.history is None else len(self.history.mean))
