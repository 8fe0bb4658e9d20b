"""The offset of the sensors' zeros in real time, learned while the cylinder slides
(``labelling.offset_identification``).

Friction changes its sign with the direction of motion, a sensor's zero does not. Over steady sliding, averaged in short
blocks, the force balance is explained by

    direction·g + h + offset + asymmetry + scale·direction·|g| + slope·direction·|g|·speed + stroke + noise

where g and h are friction and its asymmetry as known from training, and the other five terms are this session's own. A
Kalman filter (Kalman 1960) updates these five after each block; ``stroke`` restarts with each stroke, and the offset
drifts as a random walk. Rest does not count: friction holds the piston there with any force between minus and plus
breakaway, the same one in each block. A block that differs from the prediction by more than ``LARGEST_SURPRISE``
standard deviations (with the stated zeros' among them) does not count either: a saturated sensor or an end stop is no
offset. What has been learned corrects the next sample, so nothing looks ahead. If scale and slope show that friction is
not that of training (``UNLIKE``), the zeros are not corrected, and stay as uncertain as stated.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple, Self

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.machine_code import compiled, compiled_part
from cylinder_friction.recordings.columns import REFERENCE_C

OWN = 5  # Terms of a session's own: offset [N], asymmetry, scale, slope, and the present stroke's error [N]
SCALE, SLOPE, STROKE = 2, 3, 4  # Places of the last three
UNLIKE = 9.0
"""Limit of the sum of squared scale and slope, each over its variance; above it no offset is learned. 99 % of sessions
like those of training are below."""
BALANCE, PRESSURE, LOAD, WARM, ZERO = range(5)  # Rows of ``OffsetTracker.weights``
DIRECTION, RUN, COUNT, FIRST_VELOCITY, SUM_VELOCITY, EXTENDED, RETRACTED, LEVEL, OFFSET, DEVIATION = range(10)
"""Places in the state; then come means and covariance of the session's own terms, the filter's gain, sums of inputs."""
MEANS = 10
COVARIANCE = MEANS + OWN
GAIN = COVARIANCE + OWN * OWN
SUMS = GAIN + OWN
QUANTITIES = 14
"""What friction depends on: pressure p, √p, speed, its logarithm l, l², load, |load|, and temperature w, w², w·p, w·√p,
w·speed, w·l, w·l²."""
POWERS = 13  # Coefficients of the polynomial in position
LARGEST_SURPRISE = 5.0
RANGED = 4  # Quantities whose range is checked: pressure, speed, load and temperature


class OffsetSettings(NamedTuple):
    """Settings of the offset's tracker; a saved model holds them in this order."""

    slowest_m_s: float  # Velocity below which the piston rests [m/s]
    settling: float  # Samples at the start of a stroke that do not count
    block: float  # Samples of a block
    mass_kg: float  # Moving mass [kg]
    duration_s: float  # Between the velocities at a block's ends [s]
    noise_n: float  # Standard deviations of a block's force balance, and of a stroke's error [N]
    stroke_n: float
    walk: float  # Variance that the offset's drift adds per sample [N²]
    common_n: float  # Standard uncertainty of the mean offset of all sessions, which no session's motion reduces [N]
    # Speeds of training [m/s]
    speed_mean: float
    speed_deviation: float
    # Positions of training [m]
    first_position_m: float
    last_position_m: float
    # Asymmetry of friction: constant [N], and per pascal of the mean pressure
    even_constant_n: float
    even_pressure: float
    caution: float  # Factor by which the stated uncertainty is larger than the learned one
    largest_variance: float  # Variance from the sensors' stated zeros [N²], the most that is ever stated
    # Squares of scale and slope above which friction is not that of training; 0: no limit
    scale_support: float = 0.0
    slope_support: float = 0.0


class OffsetTracker(NamedTuple):
    """Numbers from training with which a step learns the sensors' offset, also in compiled code."""

    # Weights of each input, shape ``(5, inputs)``, rows as above: derivatives of the force balance [N] (less the part
    # of friction's asymmetry that grows with the load), of the mean pressure [Pa], of the load and of the temperature;
    # then the sensor's zero per newton of offset
    weights: Array
    settings: OffsetSettings
    friction: Array  # Coefficients of ``QUANTITIES`` in g [N], shape ``(14,)``
    position: Array  # Coefficients of the powers of position over its half range in g [N], shape ``(13,)``
    ranges: Array  # Smallest and largest value of each ranged quantity in training, shape ``(2, 4)``
    prior: Array  # Standard deviations of a session's own terms before the first block, shape ``(5,)``

    def to_dict(self) -> dict[str, Any]:
        """List the content as JSON-compatible values."""
        return {name: np.asarray(value).tolist() for name, value in self._asdict().items()}

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """Rebuild the tracker from ``to_dict``."""
        arrays: dict[str, Any] = {name: np.array(content[name], dtype=np.float64) for name in cls._fields}
        return cls(**arrays | {"settings": OffsetSettings(*map(float, content["settings"]))})

    def careful(self, learning: float = 1.0, stating: float = 1.0, drifting: float = 1.0) -> Self:
        """Make a more careful tracker, by factors on its assumptions.

        ``learning`` multiplies the differences between sessions and strokes, ``stating`` the stated uncertainty (which
        never exceeds that of the sensors' zeros), and ``drifting`` the zeros' drift.
        """
        settings = self.settings._replace(
            stroke_n=self.settings.stroke_n * learning,
            scale_support=self.settings.scale_support / learning**2,
            slope_support=self.settings.slope_support / learning**2,
            walk=self.settings.walk * drifting**2,
            caution=stating,
        )
        return self._replace(prior=self.prior * [1.0, *[learning] * (OWN - 1)], settings=settings)

    def new_state(self, offset_n: float = 0.0, uncertainty_n: float | None = None) -> Array:
        """Make the state before the first sample, shape ``(45 + inputs,)``.

        ``offset_n`` is the force balance's offset as far as it is known, with its standard uncertainty [N]; None is
        that of the sensors' stated zeros.

        Raises:
            ValueError: A number is not finite, or the uncertainty negative.
        """
        if not math.isfinite(offset_n) or not 0.0 <= (uncertainty_n or 0.0) < math.inf:
            got = f"{offset_n!r} and {uncertainty_n!r}"
            raise ValueError(f"expected a finite offset and an uncertainty of at least 0 N, but got {got}")
        deviations = self.prior.copy()
        if uncertainty_n is not None:  # stated as given, apart from the part that all sessions share
            own_n = math.sqrt(max(uncertainty_n**2 - self.settings.common_n**2, 0.0))
            deviations[0] = own_n / self.settings.caution
        state = np.zeros(SUMS + self.weights.shape[1])
        state[EXTENDED] = state[RETRACTED] = float(uncertainty_n is not None)
        state[MEANS] = offset_n
        state[COVARIANCE:GAIN] = np.diag(deviations**2).ravel()
        show(self.settings, state)
        return state

    def rows(self, samples: Array, velocity_m_s: Array, place: int, state: Array) -> Array:
        """Learn the offset over samples: offset and standard uncertainty [N] before each, shape ``(n, 2)``.

        Samples, shape ``(n, inputs)``, are as measured, with their causal velocities, shape ``(n,)``, and ``place``
        that of the position among the inputs. ``state`` is updated.
        """
        return np.asarray(_rows(self, state, place, velocity_m_s, samples))

    def zero_of(self, taps: Array) -> Array:
        """Compute the change of filter outputs per newton of offset; taps have shape ``(outputs, inputs, lags)``."""
        shares = taps * self.weights[ZERO][:, None]
        return np.array([math.fsum(each.ravel()) for each in shares])  # exact, however long the filters were padded


_NONE = np.zeros((0, 0))
NO_TRACKER = OffsetTracker(_NONE, OffsetSettings(*[0.0] * 17), _NONE.ravel(), _NONE.ravel(), _NONE, _NONE.ravel())


@compiled_part
def supported(settings: OffsetSettings, state: Array) -> bool:
    """Check whether this session's friction is like that of training; otherwise zeros cannot be separated from it."""
    scale, slope = state[MEANS + SCALE], state[MEANS + SLOPE]
    return bool(settings.scale_support * scale * scale + settings.slope_support * slope * slope <= 1.0)


@compiled
def show(settings: OffsetSettings, state: Array) -> None:
    """Store the offset and its standard uncertainty [N] for the next step."""
    variance = state[COVARIANCE]
    learned = min(settings.caution * settings.caution * variance, max(settings.largest_variance, variance))
    state[OFFSET] = state[MEANS]
    if not supported(settings, state):
        state[OFFSET], learned = 0.0, settings.largest_variance
    state[DEVIATION] = np.sqrt(learned + settings.common_n * settings.common_n)


@compiled_part
def offset_step(
    tracker: OffsetTracker, state: Array, place: int, velocity_m_s: float, sample: Array, valid: bool
) -> None:
    """Take the next sample, as measured, with its velocity and whether it is wholly valid; updates ``state``.

    ``place`` is the place of the position among the inputs.
    """
    settings = tracker.settings
    state[COVARIANCE] += settings.walk
    direction = 0.0
    if valid and velocity_m_s >= settings.slowest_m_s:
        direction = 1.0
    elif valid and velocity_m_s <= -settings.slowest_m_s:
        direction = -1.0
    if direction != state[DIRECTION]:
        _begin_stroke(settings, state, direction)
    state[RUN] += 1.0
    if direction != 0.0 and state[RUN] > settings.settling:
        if state[COUNT] == 0.0:
            state[FIRST_VELOCITY] = velocity_m_s
        state[COUNT] += 1.0
        state[SUM_VELOCITY] += velocity_m_s
        for channel in range(sample.shape[0]):
            state[SUMS + channel] += sample[channel]
        if state[COUNT] >= settings.block:
            _take_block(tracker, state, place, velocity_m_s)
            _clear(state)
    show(settings, state)


@compiled
def _rows(tracker: OffsetTracker, state: Array, place: int, velocity_m_s: Array, samples: Array) -> Array:
    result = np.empty((samples.shape[0], 2))
    for row in range(samples.shape[0]):
        result[row, 0], result[row, 1] = state[OFFSET], state[DEVIATION]
        offset_step(tracker, state, place, velocity_m_s[row], samples[row], True)
    return result


@compiled_part
def _begin_stroke(settings: OffsetSettings, state: Array, direction: float) -> None:
    state[DIRECTION] = direction
    state[RUN] = 0.0
    state[MEANS + STROKE] = 0.0
    for own in range(OWN):
        state[COVARIANCE + STROKE * OWN + own] = 0.0
        state[COVARIANCE + own * OWN + STROKE] = 0.0
    state[COVARIANCE + STROKE * OWN + STROKE] = settings.stroke_n * settings.stroke_n
    _clear(state)


@compiled_part
def _clear(state: Array) -> None:
    state[COUNT] = 0.0
    state[SUM_VELOCITY] = 0.0
    for place in range(SUMS, state.shape[0]):
        state[place] = 0.0


@compiled_part
def _means(weights: Array, state: Array) -> tuple[float, float, float, float]:
    """Average a block: force balance [N], pressure [Pa], load [N] and temperature [°C]."""
    balance, pressure, load, warm = 0.0, 0.0, 0.0, 0.0
    for channel in range(weights.shape[1]):
        total = state[SUMS + channel]
        balance += weights[BALANCE, channel] * total
        pressure += weights[PRESSURE, channel] * total
        load += weights[LOAD, channel] * total
        warm += weights[WARM, channel] * total
    count = state[COUNT]
    return balance / count, pressure / count, load / count, warm / count


@compiled_part
def _take_block(tracker: OffsetTracker, state: Array, place: int, velocity_m_s: float) -> None:
    """Update the session's own terms with a block's mean force balance."""
    settings, direction = tracker.settings, state[DIRECTION]
    balance, pressure, load, warm = _means(tracker.weights, state)
    warm -= REFERENCE_C
    speed = direction * state[SUM_VELOCITY] / state[COUNT]
    ranged = (pressure, speed, load, warm)
    for each in range(RANGED):
        if ranged[each] < tracker.ranges[0, each] or ranged[each] > tracker.ranges[1, each]:
            return
    acceleration = (velocity_m_s - state[FIRST_VELOCITY]) / settings.duration_s
    balance -= settings.mass_kg * acceleration
    known = _friction(tracker.friction, pressure, speed, load, warm)
    known += _along(tracker, state[SUMS + place] / state[COUNT])
    even = settings.even_constant_n + settings.even_pressure * pressure
    before = state[EXTENDED], state[RETRACTED], state[LEVEL]
    level = _level(state, direction, abs(direction * known))
    scaled = direction * level
    slope = scaled * (speed - settings.speed_mean) / settings.speed_deviation
    if not _update(settings, state, balance - direction * known - even, (1.0, level, scaled, slope, 1.0)):
        state[EXTENDED], state[RETRACTED], state[LEVEL] = before


@compiled_part
def _friction(friction: Array, pressure: float, speed: float, load: float, warm: float) -> float:
    root = np.sqrt(max(pressure, 0.0))
    logarithm = np.log(max(speed, 1e-12))
    square = logarithm * logarithm
    result = friction[0] * pressure + friction[1] * root + friction[2] * speed + friction[3] * logarithm
    result += friction[4] * square + friction[5] * load + friction[6] * abs(load)
    changing = friction[7] + friction[8] * warm + friction[9] * pressure + friction[10] * root
    changing += friction[11] * speed + friction[12] * logarithm + friction[13] * square
    return result + warm * changing


@compiled_part
def _along(tracker: OffsetTracker, position_m: float) -> float:
    """Evaluate the polynomial in position, by Horner's rule."""
    first_m, last_m = tracker.settings.first_position_m, tracker.settings.last_position_m
    along = (2.0 * position_m - first_m - last_m) / (last_m - first_m)
    along = min(max(along, -1.0), 1.0)
    result = 0.0
    for power in range(POWERS):
        result = result * along + tracker.position[POWERS - 1 - power]
    return result


@compiled_part
def _level(state: Array, direction: float, level: float) -> float:
    """Choose friction's level [N]: until both directions were seen, that of the first block.

    A varying level would seem to separate the session's scale from its offset, but that relies on friction's model
    being exact.
    """
    if direction > 0.0:
        state[EXTENDED] = 1.0
    else:
        state[RETRACTED] = 1.0
    if state[LEVEL] == 0.0:
        state[LEVEL] = level
    return level if state[EXTENDED] * state[RETRACTED] != 0.0 else state[LEVEL]


@compiled_part
def _update(
    settings: OffsetSettings, state: Array, left: float, explains: tuple[float, float, float, float, float]
) -> bool:
    """Update the Kalman filter with one number, ``left`` [N], the part that training does not explain.

    Returns whether it counted; too large a surprise changes nothing.
    """
    means, gain = state[MEANS:COVARIANCE], state[GAIN:SUMS]
    covariance = state[COVARIANCE:GAIN]
    variance = settings.noise_n * settings.noise_n
    for row in range(OWN):
        gain[row] = 0.0
        for column in range(OWN):
            gain[row] += covariance[row * OWN + column] * explains[column]
        variance += explains[row] * gain[row]
        left -= explains[row] * means[row]
    if left * left > LARGEST_SURPRISE * LARGEST_SURPRISE * (variance + settings.largest_variance):
        return False
    for row in range(OWN):
        means[row] += gain[row] * left / variance
        for column in range(OWN):
            covariance[row * OWN + column] -= gain[row] * gain[column] / variance
    return True
