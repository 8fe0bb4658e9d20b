"""Meaning of inputs and flags of an exported estimator: one list for C and FMU."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from cylinder_friction.realtime.flags import Flag
from cylinder_friction.realtime.guard import UNKNOWN_FORCE_N
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.realtime.sensor_offset import DEVIATION
from cylinder_friction.recordings.columns import (
    DRIVE_FORCE,
    LOAD_FORCE,
    OIL_TEMPERATURE,
    OTHER_POSITIONS,
    POSITION,
    PRESSURE_1,
    PRESSURE_2,
)

HOUR_S = 3600.0
UNITS = {"pa": "Pa", "m_s2": "m/s2", "m_s": "m/s", "m": "m", "n": "N", "s": "s", "c": "degC"}
"""Units by the endings of column names."""
MEANINGS = {
    PRESSURE_1: "gauge pressure on the piston side",
    PRESSURE_2: "gauge pressure on the rod side",
    POSITION: "piston position, growing as the rod extends",
    LOAD_FORCE: "external load, positive when it resists extension",
    DRIVE_FORCE: "force on the piston, positive when it pushes towards extension",
    OIL_TEMPERATURE: "oil temperature",
    **dict.fromkeys(OTHER_POSITIONS, "position of another cylinder, on which the load depends"),
}


def flags_of(model: StepModel) -> list[Flag]:
    """List the flags that a model can set."""
    depends = {Flag.OFFSET_UNKNOWN: model.offset is not None, Flag.UNMODELLED_FORCE: bool(model.guard.force_weights)}
    return [flag for flag in Flag if depends.get(flag, True)]


def stated_uncertainty_n(model: StepModel) -> float:
    """Compute the standard uncertainty of the offset before anything is learned [N]; 0 if none ever is."""
    return 0.0 if model.offset is None else float(model.offset.new_state()[DEVIATION])


def offset_texts(model: StepModel) -> dict[str, str] | None:
    """State the assumptions on the sensors' offset, as short numbers by name; None for a model that learns none."""
    if model.offset is None:
        return None
    settings = model.offset.settings
    drift_n = math.sqrt(settings.walk / model.sample_time_s * HOUR_S)
    values = {"slowest": settings.slowest_m_s, "stated_n": stated_uncertainty_n(model), "drift_n": drift_n}
    values |= {"limit_n": UNKNOWN_FORCE_N, "block": math.ceil(settings.block)}
    return {name: f"{value:.3g}" for name, value in values.items()}


@dataclass(frozen=True)
class Input:
    """One input of an exported estimator."""

    column: str  # Column of a recording
    name: str  # The column as a C identifier
    quantity: str  # The name without its unit
    unit: str | None  # A value of ``UNITS``, or None
    meaning: str  # Its meaning, with its unit


def described_inputs(columns: Sequence[str]) -> list[Input]:
    """List the inputs of a model by the names of its columns, in their order."""
    result = []
    for column in columns:
        name = re.sub(r"\W", "_", column)
        found = re.fullmatch(rf"(.+)_({'|'.join(UNITS)})", name)
        quantity, unit = (found[1], UNITS[found[2]]) if found else (name, None)
        meaning = MEANINGS.get(column, quantity.replace("_", " ")) + (f" [{unit}]" if unit else "")
        result.append(Input(column, name, quantity, unit, meaning))
    return result
