"""Output of a real-time step: one estimate with its bounds, and flags on how far to trust it."""

from enum import IntFlag
from typing import NamedTuple


class Flag(IntFlag):
    """Bits of a step's flags; 0 where all is well. The same numbers in every runtime."""

    NOT_READY = 1
    """No sample with all inputs valid has come yet; estimate and bounds are 0."""
    WARMING = 2
    """The state still remembers the reset."""
    OUTSIDE = 4
    """An input lies outside the training range widened by 5 %; the estimate is an extrapolation."""
    INVALID_PRESSURE_1 = 8
    """Pressure 1 is no number or no reading of a working sensor; its last valid value stands in."""
    INVALID_PRESSURE_2 = 16
    """The same of pressure 2."""
    INVALID_POSITION = 32
    """The same of the position."""
    FROZEN = 64
    """An input repeats one value although it cannot be constant."""
    RECOVERING = 128
    """All inputs are valid again, but the state still remembers invalid or frozen ones."""
    INVALID_OTHER = 256
    """The same as ``INVALID_POSITION``, of an input that is neither a raw pressure nor the position."""

    OFFSET_UNKNOWN = 512
    """The offset of the sensors' zeros is no better known than stated: since the reset the cylinder has not yet slid in
    both directions. The estimate goes on, with bounds as wide as that."""
    UNMODELLED_FORCE = 1024
    """The force balance lies beyond its range in training, or did until the piston moves a while within it, or both
    pressures are far below those of training: an external load, an end stop, or pressures that are wrong or in another
    unit. The estimate goes on, and takes that force for friction."""

    @classmethod
    def names(cls, flags: int) -> tuple[str, ...]:
        """Return the names of the bits that are set, lowest first."""
        return tuple(flag.name for flag in cls if flags & flag and flag.name is not None)


def invalid_flag(column: str) -> Flag:
    """Return the flag that an invalid value of an input sets."""
    known = {
        "pressure_1_pa": Flag.INVALID_PRESSURE_1,
        "pressure_2_pa": Flag.INVALID_PRESSURE_2,
        "position_m": Flag.INVALID_POSITION,
    }
    return known.get(column, Flag.INVALID_OTHER)


class Estimate(NamedTuple):
    """One step's output."""

    friction_n: float  # Friction [N], positive when it opposes positive velocity
    # Bounds around it [N]; not to be trusted while a flag but ``OUTSIDE`` or ``OFFSET_UNKNOWN`` is set
    lower_n: float
    upper_n: float
    flags: int  # Bits of ``Flag``
