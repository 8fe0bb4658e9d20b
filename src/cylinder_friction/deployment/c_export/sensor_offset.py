"""The offset of the sensors' zeros in C: the numbers of ``realtime.sensor_offset`` by name."""

import math

from cylinder_friction.deployment.c_export.filters import FilterBank
from cylinder_friction.realtime import sensor_offset as at
from cylinder_friction.realtime.guard import UNKNOWN_FORCE_N
from cylinder_friction.realtime.model import StepModel

HOUR_S = 3600.0
BLOCK_OPERATIONS = 150  # Of the step that ends a block, beside those that count once per input and row


def offset_operations(bank: FilterBank, inputs: int) -> int:
    """Return the operations that learning the offset adds to a step, at worst."""
    return BLOCK_OPERATIONS + 5 * inputs + 2 * len(bank.rows)


def offset_values(model: StepModel, bank: FilterBank) -> dict[str, object] | None:
    """Return the values of the offset's template; None for a model that learns no offset."""
    tracker = model.offset
    if tracker is None:
        return None
    settings, weights = tracker.settings.tolist(), tracker.weights
    return {
        "largest_surprise": f"{at.LARGEST_SURPRISE:g}",
        "surprise_square": at.LARGEST_SURPRISE**2,
        "zeros": tracker.zero_of(bank.rows).tolist(),
        "balance": weights[at.BALANCE].tolist(),
        "pressure": weights[at.PRESSURE].tolist(),
        "load": weights[at.LOAD].tolist(),
        "warm": weights[at.WARM].tolist(),
        "reference_c": at.REFERENCE_C,
        "lowest": tracker.ranges[0].tolist(),
        "highest": tracker.ranges[1].tolist(),
        "friction": tracker.friction.tolist(),
        "position": tracker.position.tolist(),
        "variances": (tracker.prior**2).tolist(),
        "slowest": settings[at.SLOWEST],
        "settling": math.floor(settings[at.SETTLING]),
        "block": math.ceil(settings[at.BLOCK]),
        "mass": settings[at.MASS],
        "duration": settings[at.DURATION],
        "noise_variance": settings[at.NOISE] ** 2,
        "stroke_variance": settings[at.STROKE] ** 2,
        "rest_variance": settings[at.REST] ** 2,
        "walk": settings[at.WALK],
        "common_variance": settings[at.COMMON] ** 2,
        "speed_mean": settings[at.SPEED_MEAN],
        "speed_deviation": settings[at.SPEED_DEVIATION],
        "first": settings[at.FIRST_POSITION],
        "last": settings[at.LAST_POSITION],
        "span": settings[at.LAST_POSITION] - settings[at.FIRST_POSITION],
        "even_constant": settings[at.EVEN_CONSTANT],
        "even_pressure": settings[at.EVEN_PRESSURE],
        "caution_square": settings[at.CAUTION] ** 2,
        "largest_variance": settings[at.LARGEST],
        "stated_n": stated_uncertainty_n(model),
        "drift_n": math.sqrt(settings[at.WALK] / model.sample_time_s * HOUR_S),
        "limit_n": UNKNOWN_FORCE_N,
    }


def stated_uncertainty_n(model: StepModel) -> float:
    """Return the standard uncertainty of the offset before anything is learned [N]; 0 where none ever is."""
    return 0.0 if model.offset is None else float(model.offset.new_state()[at.DEVIATION])
