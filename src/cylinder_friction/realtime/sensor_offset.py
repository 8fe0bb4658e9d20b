"""The offset of the sensors' zeros, learned while the cylinder slides: ``labelling.sensor_offset`` in real time.

Friction changes its sign with the direction of motion, a sensor's zero does not. Over steady sliding, averaged in short
blocks, the force balance is explained by

    direction·g + h + offset + asymmetry + scale·direction·|g| + slope·direction·|g|·speed + stroke + noise

where g and h are friction and its asymmetry as known from training, and the others what this session has of its own. A
Kalman filter (Kalman 1960) follows these five after each block; ``stroke`` begins anew with each stroke, and the offset
drifts as a random walk. Before the first stroke a rest's first block counts too: all of its friction is the stroke's
error then, so that rest shows offsets that are not far smaller than that. A block further from what was expected than
``LARGEST_SURPRISE`` standard deviations, the stated zeros' among them, does not count: a saturated sensor or an end
stop is no offset. What has been learned corrects the next sample, so that nothing looks ahead.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from typing import Any, Self

import numba
import numpy as np

from cylinder_friction.arrays import Array

OWN = 5  # What a session has of its own: offset [N], asymmetry, scale, slope, and the present stroke's error [N]
BALANCE, PRESSURE, LOAD, WARM, ZERO = range(5)  # Rows of ``OffsetTracker.weights``
SLOWEST, SETTLING, BLOCK, MASS, DURATION, NOISE, STROKE, WALK, COMMON, SPEED_MEAN, SPEED_DEVIATION = range(11)
FIRST_POSITION, LAST_POSITION, EVEN_CONSTANT, EVEN_PRESSURE, CAUTION, LARGEST, REST = range(11, 18)
"""Places in ``OffsetTracker.settings``."""
DIRECTION, RUN, COUNT, FIRST_VELOCITY, SUM_VELOCITY, EXTENDED, RETRACTED, LEVEL, OFFSET, DEVIATION = range(10)
"""Places in the state; then come means and covariance of what the session has of its own, room for the filter's gain,
and sums of the inputs."""
NOWHERE = 2.0
"""Direction on invalid samples; 0 at rest."""
MEANS = 10
COVARIANCE = MEANS + OWN
GAIN = COVARIANCE + OWN * OWN
SUMS = GAIN + OWN
REFERENCE_C = 40.0  # Temperatures count from here [°C]
QUANTITIES = 14
"""What friction depends on: pressure p, √p, speed, its logarithm l, l², load, |load|, and temperature w, w², w·p, w·√p,
w·speed, w·l, w·l²."""
POWERS = 13  # Of the polynomial in position, constant included
LARGEST_SURPRISE = 5.0
RANGED = 4  # Quantities whose range is checked: pressure, speed, load and temperature


@dataclass(frozen=True, eq=False)
class OffsetTracker:
    """What a step must know to learn the offset."""

    # Of each input, shape ``(5, inputs)``, see the rows above: derivatives of the force balance [N], less what of
    # friction's asymmetry grows with the load; of the mean pressure [Pa], of the load and of the temperature; and zero
    # of the sensor that one newton of offset stands for
    weights: Array
    settings: Array  # See the places above
    friction: Array  # Coefficients of ``QUANTITIES`` in g [N], shape ``(14,)``
    position: Array  # Coefficients of the powers of position over its half range in g [N], shape ``(13,)``
    ranges: Array  # Smallest and largest value of each ranged quantity in training, shape ``(2, 4)``
    prior: Array  # Standard deviations of what a session has of its own before the first block, shape ``(5,)``

    def to_dict(self) -> dict[str, Any]:
        """Return the content as JSON-compatible values."""
        return {name: value.tolist() for name, value in asdict(self).items()}

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """Return what ``to_dict`` wrote."""
        return cls(**{each.name: np.array(content[each.name], dtype=np.float64) for each in fields(cls)})

    def careful(self, learning: float = 1.0, stating: float = 1.0, resting: float = 1.0, drifting: float = 1.0) -> Self:
        """Return a tracker that is more careful.

        Args:
            learning: It learns as if sessions and strokes differed so many times as much as in training.
            stating: It states so many times the uncertainty that follows, though never more than the sensors' zeros'.
            resting: It takes friction at rest for so many times as large.
            drifting: It takes zeros to drift so many times as fast.
        """
        prior, settings = self.prior.copy(), self.settings.copy()
        prior[1:] *= learning
        settings[[STROKE, REST]] *= learning, resting
        settings[WALK] *= drifting**2
        settings[CAUTION] = stating
        return replace(self, prior=prior, settings=settings)

    def new_state(self, offset_n: float = 0.0, uncertainty_n: float | None = None) -> Array:
        """Return the state before the first sample, shape ``(45 + inputs,)``.

        Args:
            offset_n: Offset of the force balance, if something is known of it [N].
            uncertainty_n: Its standard uncertainty [N]; None: as the sensors' zeros were stated.

        Raises:
            ValueError: A number is not finite, or the uncertainty negative.
        """
        refuse_impossible(offset_n, uncertainty_n)
        deviations, known = self.prior.copy(), uncertainty_n is not None
        if uncertainty_n is not None:  # what is stated of it is what was given, but for what all sessions share
            own_n = math.sqrt(max(uncertainty_n**2 - self.common_n**2, 0.0))
            deviations[0] = own_n / float(self.settings[CAUTION])
        state = np.zeros(SUMS + self.weights.shape[1])
        state[EXTENDED] = state[RETRACTED] = float(known)
        state[DIRECTION], state[MEANS] = NOWHERE, offset_n
        state[COVARIANCE:GAIN] = np.diag(deviations**2).ravel()
        show(self.settings, state)
        return state

    @property
    def common_n(self) -> float:
        """Standard uncertainty of the mean offset of all sessions, which no session's own motion can reduce [N]."""
        return float(self.settings[COMMON])

    def constants(self) -> tuple[Array, Array, Array, Array, Array]:
        """Return the arrays that ``offset_step`` takes first."""
        return self.weights, self.settings, self.friction, self.position, self.ranges

    def rows(self, samples: Array, velocity_m_s: Array, place: int, state: Array) -> Array:
        """Return offset and standard uncertainty [N] that each sample meets, shape ``(n, 2)``; changes ``state``.

        Args:
            samples: As measured, shape ``(n, inputs)``.
            velocity_m_s: The causal velocity of each, shape ``(n,)``.
            place: That of the position among the inputs.
            state: From ``new_state``.
        """
        return np.asarray(_rows(*self.constants(), state, place, velocity_m_s, samples))

    def zero_of(self, taps: Array) -> Array:
        """Return what one newton of offset adds to filters' outputs; taps have shape ``(outputs, inputs, lags)``."""
        shares = taps * self.weights[ZERO][:, None]
        return np.array([math.fsum(each.ravel()) for each in shares])  # exact, however long the filters were padded


def refuse_impossible(offset_n: float, uncertainty_n: float | None) -> None:
    """Refuse what is no offset to start from, or no uncertainty of one; None stands for an unknown one.

    Raises:
        ValueError: A number is not finite, or the uncertainty negative.
    """
    if not math.isfinite(offset_n) or not 0.0 <= (uncertainty_n or 0.0) < math.inf:
        raise ValueError(
            f"expected a finite offset and an uncertainty of at least 0 N, but got {offset_n!r} and {uncertainty_n!r}"
        )


@numba.njit(cache=True)
def show(settings: Array, state: Array) -> None:
    """Put the offset and its standard uncertainty [N] where the next step finds them."""
    state[OFFSET] = state[MEANS]
    learned = min(settings[CAUTION] * settings[CAUTION] * state[COVARIANCE], max(settings[LARGEST], state[COVARIANCE]))
    state[DEVIATION] = np.sqrt(learned + settings[COMMON] * settings[COMMON])


@numba.njit(cache=True)
def offset_step(
    weights: Array,
    settings: Array,
    friction: Array,
    position: Array,
    ranges: Array,
    state: Array,
    place: int,
    velocity_m_s: float,
    sample: Array,
    valid: bool,
) -> None:
    """Take the next sample, as measured, its velocity and whether all of it is valid; changes ``state``.

    ``place`` is that of the position among the inputs.
    """
    state[COVARIANCE] += settings[WALK]
    direction = 0.0 if valid else NOWHERE
    if valid and velocity_m_s >= settings[SLOWEST]:
        direction = 1.0
    elif valid and velocity_m_s <= -settings[SLOWEST]:
        direction = -1.0
    if direction != state[DIRECTION]:
        _begin_stroke(settings, state, direction)
    state[RUN] += 1.0
    resting = direction == 0.0 and state[RUN] <= settings[BLOCK]
    if resting or (abs(direction) == 1.0 and state[RUN] > settings[SETTLING]):
        if state[COUNT] == 0.0:
            state[FIRST_VELOCITY] = velocity_m_s
        state[COUNT] += 1.0
        state[SUM_VELOCITY] += velocity_m_s
        for channel in range(sample.shape[0]):
            state[SUMS + channel] += sample[channel]
        if state[COUNT] >= settings[BLOCK]:
            _take_block(weights, settings, friction, position, ranges, state, place, velocity_m_s)
            _clear(state)
    show(settings, state)


@numba.njit(cache=True)
def _rows(
    weights: Array,
    settings: Array,
    friction: Array,
    position: Array,
    ranges: Array,
    state: Array,
    place: int,
    velocity_m_s: Array,
    samples: Array,
) -> Array:
    result = np.empty((samples.shape[0], 2))
    for row in range(samples.shape[0]):
        result[row, 0], result[row, 1] = state[OFFSET], state[DEVIATION]
        offset_step(weights, settings, friction, position, ranges, state, place, velocity_m_s[row], samples[row], True)
    return result


@numba.njit(cache=True)
def _begin_stroke(settings: Array, state: Array, direction: float) -> None:
    state[DIRECTION] = direction
    state[RUN] = 0.0
    state[MEANS + 4] = 0.0
    for own in range(OWN):
        state[COVARIANCE + 4 * OWN + own] = 0.0
        state[COVARIANCE + own * OWN + 4] = 0.0
    deviation = settings[REST] if direction == 0.0 else settings[STROKE]
    state[COVARIANCE + 4 * OWN + 4] = deviation * deviation
    _clear(state)


@numba.njit(cache=True)
def _clear(state: Array) -> None:
    state[COUNT] = 0.0
    state[SUM_VELOCITY] = 0.0
    state[SUMS:] = 0.0


@numba.njit(cache=True)
def _mean(weights: Array, row: int, state: Array) -> float:
    total = 0.0
    for channel in range(weights.shape[1]):
        total += weights[row, channel] * state[SUMS + channel]
    return total / state[COUNT]


@numba.njit(cache=True)
def _take_block(
    weights: Array,
    settings: Array,
    friction: Array,
    position: Array,
    ranges: Array,
    state: Array,
    place: int,
    velocity_m_s: float,
) -> None:
    """Let what the session has of its own explain a block's mean force balance."""
    direction = state[DIRECTION]
    if direction == 0.0 and state[EXTENDED] + state[RETRACTED] > 0.0:
        return
    pressure = _mean(weights, PRESSURE, state)
    load = _mean(weights, LOAD, state)
    warm = _mean(weights, WARM, state) - REFERENCE_C
    speed = direction * state[SUM_VELOCITY] / state[COUNT] if direction != 0.0 else settings[SPEED_MEAN]
    ranged = (pressure, speed, load, warm)
    for each in range(RANGED):
        if ranged[each] < ranges[0, each] or ranged[each] > ranges[1, each]:
            return
    acceleration = (velocity_m_s - state[FIRST_VELOCITY]) / settings[DURATION]
    balance = _mean(weights, BALANCE, state) - settings[MASS] * acceleration
    known = _friction(friction, pressure, speed, load, warm)
    known += _along(settings, position, state[SUMS + place] / state[COUNT])
    even = settings[EVEN_CONSTANT] + settings[EVEN_PRESSURE] * pressure
    before = state[EXTENDED], state[RETRACTED], state[LEVEL]
    level = _level(state, direction, abs(direction * known))
    scaled = direction * level
    slope = scaled * (speed - settings[SPEED_MEAN]) / settings[SPEED_DEVIATION]
    if not _update(settings, state, balance - direction * known - even, (1.0, level, scaled, slope, 1.0)):
        state[EXTENDED], state[RETRACTED], state[LEVEL] = before


@numba.njit(cache=True)
def _friction(friction: Array, pressure: float, speed: float, load: float, warm: float) -> float:
    root = np.sqrt(max(pressure, 0.0))
    logarithm = np.log(max(speed, 1e-12))
    square = logarithm * logarithm
    result = friction[0] * pressure + friction[1] * root + friction[2] * speed + friction[3] * logarithm
    result += friction[4] * square + friction[5] * load + friction[6] * abs(load)
    changing = friction[7] + friction[8] * warm + friction[9] * pressure + friction[10] * root
    changing += friction[11] * speed + friction[12] * logarithm + friction[13] * square
    return result + warm * changing


@numba.njit(cache=True)
def _along(settings: Array, position: Array, position_m: float) -> float:
    """Return the polynomial in position, by Horner's rule."""
    span = settings[LAST_POSITION] - settings[FIRST_POSITION]
    along = (2.0 * position_m - settings[FIRST_POSITION] - settings[LAST_POSITION]) / span
    along = min(max(along, -1.0), 1.0)
    result = 0.0
    for power in range(POWERS):
        result = result * along + position[POWERS - 1 - power]
    return result


@numba.njit(cache=True)
def _level(state: Array, direction: float, level: float) -> float:
    """Return friction's level [N]; until both directions were seen that of the first block.

    A level that varies would seem to separate the session's scale from its offset, though by no more than friction's
    model is right.
    """
    if direction > 0.0:
        state[EXTENDED] = 1.0
    elif direction < 0.0:
        state[RETRACTED] = 1.0
    if state[LEVEL] == 0.0:
        state[LEVEL] = level
    return level if state[EXTENDED] * state[RETRACTED] != 0.0 else state[LEVEL]


@numba.njit(cache=True)
def _update(settings: Array, state: Array, left: float, explains: tuple[float, float, float, float, float]) -> bool:
    """Take the Kalman filter's step for one number, ``left`` [N], of what was not known from training.

    Returns whether it was one; too large a surprise changes nothing.
    """
    means, covariance, gain = state[MEANS:COVARIANCE], state[COVARIANCE:GAIN], state[GAIN:SUMS]
    variance = settings[NOISE] * settings[NOISE]
    for row in range(OWN):
        gain[row] = 0.0
        for column in range(OWN):
            gain[row] += covariance[row * OWN + column] * explains[column]
        variance += explains[row] * gain[row]
        left -= explains[row] * means[row]
    if left * left > LARGEST_SURPRISE * LARGEST_SURPRISE * (variance + settings[LARGEST]):
        return False
    for row in range(OWN):
        means[row] += gain[row] * left / variance
    for row in range(OWN):
        for column in range(OWN):
            covariance[row * OWN + column] -= gain[row] * gain[column] / variance
    return True
