"""Everything that one step of an estimator needs, as plain arrays: what every runtime is built from."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from cylinder_friction.arrays import Array
from cylinder_friction.realtime.position_load import PositionLoad, channel_names
from cylinder_friction.realtime.sensor_offset import OffsetTracker
from cylinder_friction.realtime.trained_for import TrainedFor
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS

if TYPE_CHECKING:
    from cylinder_friction.realtime.forest import Forest
    from cylinder_friction.realtime.history import History
    from cylinder_friction.realtime.lstm import LstmWeights


ForestSees = Literal["nothing", "hidden", "hidden_head_features", "features"]


@dataclass(frozen=True)
class Guard:
    """What a sample must be, and what happens if it is not."""

    # A value outside is no reading of a working sensor; one number per input
    accept_lower: tuple[float, ...]
    accept_upper: tuple[float, ...]
    # Outside, the estimate goes on and is flagged as an extrapolation
    trained_lower: tuple[float, ...]
    trained_upper: tuple[float, ...]
    freeze_travel_m: float  # A pressure that stays exactly constant over more travel than this is frozen [m]
    freeze_samples: int  # A position that stays exactly constant longer is frozen, if the force is too large to hold
    freeze_force_n: float  # More than the piston can hold at rest [N]
    warm_up_samples: int  # Steps after a reset in which the estimate is not yet to be trusted
    recovery_samples: int  # The same after the last bad sample
    # Range of the force balance (see ``realtime.unmodelled_force``): what one unit of each channel adds to it [N]; then
    # lines over the sum of both pressures, constant [N] and slope [N/Pa]; nothing if it is not known
    force_weights: tuple[float, ...] = ()
    sliding_lower: tuple[float, ...] = ()  # Of the balance along the motion
    sliding_upper: tuple[float, ...] = ()
    largest_force: tuple[float, ...] = ()  # Of its size while the piston does not slide
    clear_samples: int = 0  # Motion within the range of sliding for so long refutes an unmodelled force
    least_pressure_pa: float = -1e12  # A smaller sum of both pressures is that of no cylinder at work [Pa]


@dataclass(frozen=True)
class Bounds:
    """An interval for friction around an estimate, by regime of motion (see ``realtime.bounds``).

    The regimes are standstill, creep, sliding, and the moments just after a reversal or start.
    """

    lower_n: tuple[float, ...]  # Added to the estimate [N], one per regime, shape ``(4,)``
    upper_n: tuple[float, ...]  # The same for the upper bound [N]
    standstill_m_s: float  # Slower, the piston stands still [m/s]
    creep_m_s: float  # Slower, it creeps [m/s]; as ``standstill_m_s`` if that is not known
    reversal_samples: int  # How long a reversal or start lasts
    # That what the bounds hold lies between them, over the sessions and samples like those of the calibration
    probability: float
    # ``friction``: the sensors' stated uncertainty is part of the bounds; ``label``: it is not known, and a sensor's
    # offset, which shifts label and estimate alike, is not covered
    holds: Literal["friction", "label"] = "label"
    # Standard deviation of the errors with the sensors' offset known, one per regime [N]: with an offset as uncertain
    # as s, bounds are √(1 + (s/spread)²) times as far away; 0 if the step learns no offset, and they never change
    spread_n: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)

    def in_words(self) -> str:
        """Return what the bounds hold, and under which assumption: the one sentence wherever bounds are shown."""
        if self.probability == 1.0:
            return "as wide as can be, as this model's errors were never calibrated"
        where = "over all sessions with pressures as quiet as in training"
        what = f"lies between the bounds with probability {self.probability:g} {where}"
        if self.holds == "friction":
            return f"friction {what}, if the sensors are as accurate as stated for the calibration"
        return f"the label {what}; friction does only if the sensors' zeros are right: nothing was stated about them"


GuardOrBounds = TypeVar("GuardOrBounds", Guard, Bounds)


def from_json(kind: type[GuardOrBounds], values: dict[str, Any] | None) -> GuardOrBounds | None:
    """Return a guard or bounds from JSON, which has lists in place of tuples; None for None."""
    if values is None:
        return None
    known: dict[str, Any] = {key: tuple(value) if isinstance(value, list) else value for key, value in values.items()}
    return kind(**known)


@dataclass(frozen=True)
class StepModel:
    """One estimator, ready for any runtime."""

    sample_time_s: float  # Between two samples [s]; an LSTM cannot take another
    feature_taps: Array  # FIR filters on raw samples, shape ``(features, channels, lags)``
    feature_limits: Array  # Where positive, a filtered value y becomes ``y / (|y| + limit)``, shape ``(features,)``
    # Taken off, then divided by, shape ``(features,)``
    feature_mean: Array
    feature_scale: Array
    base_taps: Array  # The force that is corrected [N], shape ``(channels, lags)``; zeros if there is none
    velocity_taps: Array  # The causal velocity that bounds go by [m/s], shape ``(channels, lags)``
    network: LstmWeights | None  # None for a model without LSTM
    forest: Forest | None  # None for a model without forest
    forest_sees: ForestSees  # Which inputs the forest takes, in this order: hidden state, head, features
    head_counts: bool  # Whether the network's head is part of the estimate
    # What the network's and the forest's outputs mean [N]
    target_mean_n: float
    target_scale_n: float
    guard: Guard  # What a sample must be
    bounds: Bounds  # The interval around the estimate
    # Columns of a recording that make up a sample, in this order; ``position_m`` is one
    inputs: tuple[str, ...] = SAMPLE_COLUMNS
    # Features of the motion so far, which follow the linear ones; None for a model without
    history: History | None = None
    # How the offset of the sensors' zeros is learned; None: it is not, and stays in the estimate
    offset: OffsetTracker | None = None
    # The load that position decides, a channel beside the inputs; None: it is an input, or there is none
    position_load: PositionLoad | None = None
    lag_s: float = 0.0  # How long before its sample a step's friction was, and its bounds [s]
    trained_for: TrainedFor | None = None  # Where it belongs; None: not known

    @cached_property
    def channels(self) -> tuple[str, ...]:
        """What the filters take: the inputs, and a load that position decides."""
        return channel_names(self.inputs, self.position_load)

    @cached_property
    def position(self) -> int:
        """Place of the position among the inputs."""
        return self.inputs.index("position_m")

    @cached_property
    def pressures(self) -> tuple[int, ...]:
        """Places of the raw pressures among the inputs: those that cannot stay constant over a travel."""
        return tuple(self.inputs.index(name) for name in SAMPLE_COLUMNS[:2] if name in self.inputs)

    @property
    def feature_count(self) -> int:
        """Number of features that network and forest take, history included."""
        return len(self.feature_taps) + (0 if self.history is None else len(self.history.mean))
