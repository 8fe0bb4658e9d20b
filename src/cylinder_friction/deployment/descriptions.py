"""Meaning of inputs, outputs and flags of an exported estimator: one list for C, FMU and ONNX."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from cylinder_friction.realtime.flags import Flag, invalid_flag
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.recordings.columns import (
    DRIVE_FORCE,
    LOAD_FORCE,
    OIL_TEMPERATURE,
    POSITION,
    PRESSURE_1,
    PRESSURE_2,
)

_INVALID = "is NaN, infinite or no reading of a working sensor; its last valid value stands in"
FLAG_MEANINGS = {
    Flag.NOT_READY: "No sample with all inputs valid has come yet; friction and bounds are 0",
    Flag.WARMING: "The state still remembers the start",
    Flag.OUTSIDE: "An input lies outside the training range widened by 5 %; the estimate is an extrapolation",
    Flag.INVALID_PRESSURE_1: f"Pressure 1 {_INVALID}",
    Flag.INVALID_PRESSURE_2: f"Pressure 2 {_INVALID}",
    Flag.INVALID_POSITION: f"The position {_INVALID}",
    Flag.FROZEN: "An input repeats one value although it cannot be constant",
    Flag.RECOVERING: "All inputs are valid again, but the state still remembers invalid or frozen ones",
    Flag.INVALID_OTHER: f"Another input {_INVALID}",
    Flag.OFFSET_UNKNOWN: "The cylinder has not slid in both directions yet: the offset of the sensors' zeros is no "
    "better known than stated, and the bounds are as wide as that",
    Flag.UNMODELLED_FORCE: "The force balance lies beyond its range in training, or did until the piston moves a "
    "while within it, or both pressures are far below those of training: an external load, an end stop, or pressures "
    "that are wrong or in another unit, which the estimate takes for friction",
}

UNITS = {"pa": "Pa", "m_s2": "m/s2", "m_s": "m/s", "m": "m", "n": "N", "s": "s", "c": "degC"}
"""Unit by the end of a column's name."""
MEANINGS = {
    PRESSURE_1: "gauge pressure on the piston side",
    PRESSURE_2: "gauge pressure on the rod side",
    POSITION: "piston position, growing as the rod extends",
    LOAD_FORCE: "external load, positive when it resists extension",
    DRIVE_FORCE: "force on the piston, positive when it pushes towards extension",
    OIL_TEMPERATURE: "oil temperature",
}


def flag_meanings(model: StepModel) -> dict[Flag, str]:
    """Return the meaning of each flag that a model can set."""
    can_set = {Flag.OFFSET_UNKNOWN: model.offset is not None, Flag.UNMODELLED_FORCE: bool(model.guard.force_weights)}
    return {flag: meaning for flag, meaning in FLAG_MEANINGS.items() if can_set.get(flag, True)}


@dataclass(frozen=True)
class Input:
    """One input of an exported estimator."""

    column: str  # Column of a recording
    name: str  # The column as a C identifier
    quantity: str  # The name without its unit
    unit: str | None  # A value of ``UNITS``, or None
    meaning: str  # In words, with its unit
    flag: Flag  # Set while a value is invalid


def described_inputs(columns: Sequence[str]) -> list[Input]:
    """Return the inputs of a model by the names of its columns, in their order."""
    result = []
    for column in columns:
        name = re.sub(r"\W", "_", column)
        found = re.fullmatch(rf"(.+)_({'|'.join(UNITS)})", name)
        quantity, unit = (found[1], UNITS[found[2]]) if found else (name, None)
        meaning = MEANINGS.get(column, quantity.replace("_", " ")) + (f" [{unit}]" if unit else "")
        result.append(Input(column, name, quantity, unit, meaning, invalid_flag(column)))
    return result
