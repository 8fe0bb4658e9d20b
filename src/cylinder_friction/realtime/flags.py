"""Output of a real-time step: one estimate with its bounds, and flags on how far to trust it.

Each flag is defined here and nowhere else. Headers, FMUs, graphs, pages and guides read bit, name and texts from here.
"""

from collections.abc import Mapping
from enum import IntFlag
from functools import reduce
from operator import or_
from typing import Literal, NamedTuple, Self

FlagKind = Literal["settling", "sensor", "range"]
"""The estimate settles; a sensor fails; or something lies outside what the model was trained on."""

_INVALID = "is NaN, infinite or no reading of a working sensor; its last valid value stands in"
_CHECK_SENSOR = "check that sensor, its wiring and its unit"

LEAST_ROWS, MOST_UNKNOWN = 1000, 0.25
"""Rows of a session before it is spoken of, and the share of them that a model may not know."""


class Flag(IntFlag):
    """Bits of a step's flags; 0 means no objection. Every runtime uses the same numbers.

    Show ``meaning`` and ``advice`` of a flag to a person. The bounds hold while no flag other than ``OUTSIDE`` and
    ``OFFSET_UNKNOWN`` is set.

    Example:
        >>> from cylinder_friction.realtime.flags import Flag
        >>> Flag.names(6)
        ('WARMING', 'OUTSIDE')
        >>> Flag.OUTSIDE.advice
        'train on recordings that reach as far'
    """

    kind: FlagKind
    meaning: str
    advice: str  # What to do about it

    def __new__(cls, bit: int, kind: FlagKind, meaning: str, advice: str) -> Self:
        flag = int.__new__(cls, bit)
        flag._value_, flag.kind, flag.meaning, flag.advice = bit, kind, meaning, advice
        return flag

    NOT_READY = (
        1,
        "settling",
        "No sample with all inputs valid has come yet; friction and bounds are 0",
        "wait for a sample with all inputs valid",
    )
    WARMING = 2, "settling", "The state still remembers the start, for 3 s", "wait, or warm up at the first sample"
    OUTSIDE = (
        4,
        "range",
        "An input lies outside the training range widened by 5 %; the estimate is an extrapolation",
        "train on recordings that reach as far",
    )
    INVALID_PRESSURE_1 = 8, "sensor", f"Pressure 1 {_INVALID}", _CHECK_SENSOR
    INVALID_PRESSURE_2 = 16, "sensor", f"Pressure 2 {_INVALID}", _CHECK_SENSOR
    INVALID_POSITION = 32, "sensor", f"The position {_INVALID}", _CHECK_SENSOR
    FROZEN = (
        64,
        "sensor",
        "An input repeats one value although it cannot be constant: a pressure over more travel than its "
        "converter's steps explain, or the position for 2 s under twice the largest friction of training",
        "check that sensor and what passes its readings on",
    )
    RECOVERING = (
        128,
        "settling",
        "All inputs are valid again, but the state still remembers invalid or frozen ones, for 3 s",
        "wait",
    )
    INVALID_OTHER = 256, "sensor", f"Another input {_INVALID}", _CHECK_SENSOR
    OFFSET_UNKNOWN = (
        512,
        "settling",
        "The cylinder has not slid in both directions yet, or its friction is not that of training: the offset of the "
        "sensors' zeros is no better known than stated, and the bounds are as wide as that",
        "slide in both directions, or start from a known offset",
    )
    UNMODELLED_FORCE = (
        1024,
        "range",
        "The force balance lies beyond its range in training, or did until the piston has moved a while within it, or "
        "both pressures are far below those of training: an external load, an end stop, or pressures that are wrong or "
        "in another unit, which the estimate takes for friction",
        "take the load off or use a model that knows it; check the pressures and their unit",
    )

    @classmethod
    def names(cls, flags: int) -> tuple[str, ...]:
        """List the names of the bits that are set, lowest first."""
        return tuple(flag.name for flag in cls if flags & flag and flag.name is not None)

    @classmethod
    def of_kind(cls, kind: FlagKind) -> int:
        """Combine the bits of all flags of a kind."""
        return reduce(or_, (flag.value for flag in cls if flag.kind == kind))


def invalid_flag(column: str) -> Flag:
    """Look up the flag that an invalid value of an input sets.

    Both pressures and the position have a flag of their own; all other inputs share ``INVALID_OTHER``. A value is
    invalid if it is NaN, infinite, or further outside the training range than any working sensor reads.

    Example:
        >>> from cylinder_friction.realtime.flags import invalid_flag
        >>> invalid_flag("position_m").name, invalid_flag("oil_temperature_c").name
        ('INVALID_POSITION', 'INVALID_OTHER')
    """
    known = {
        "pressure_1_pa": Flag.INVALID_PRESSURE_1,
        "pressure_2_pa": Flag.INVALID_PRESSURE_2,
        "position_m": Flag.INVALID_POSITION,
    }
    return known.get(column, Flag.INVALID_OTHER)


UNKNOWN = {
    Flag.NOT_READY: "of the rows have no estimate: no sample with a valid reading of every input came before them",
    Flag.UNMODELLED_FORCE: "of the rows hold a force that this model does not know",
    Flag.OUTSIDE: "of the rows lie outside the range of its training",
}
"""Why the rows with a flag have estimates that are not to be used as they are."""


def unknown_in_words(rows: int, by_flag: Mapping[str, int]) -> str:
    """State why estimates are not to be used as they are, from the number of rows with each flag; empty if they are.

    The result is empty for fewer than a thousand rows, and if at most a quarter of the rows is unknown to the model.

    Example:
        >>> from cylinder_friction.realtime.flags import unknown_in_words
        >>> unknown_in_words(2000, {"OUTSIDE": 900})
        '45 % of the rows lie outside the range of its training'
        >>> unknown_in_words(2000, {"OUTSIDE": 100})
        ''
    """
    if rows < LEAST_ROWS:
        return ""
    for flag, words in UNKNOWN.items():
        share = by_flag.get(str(flag.name), 0) / rows
        if share > MOST_UNKNOWN:
            return f"{100.0 * share:.0f} % {words}"
    return ""


class Estimate(NamedTuple):
    """Output of one step: friction with bounds [N], and flags.

    Friction is positive when it opposes positive velocity. Check ``flags`` before you use the numbers: 0 means no
    objection, and ``Flag.names(flags)`` lists the objections. A step without any valid sample so far gives zeros.

    Example:
        >>> from cylinder_friction.realtime.flags import Estimate
        >>> estimate = Estimate(friction_n=310.0, lower_n=295.0, upper_n=325.0, flags=0)
        >>> estimate.upper_n - estimate.lower_n
        30.0
    """

    friction_n: float  # Friction [N], positive when it opposes positive velocity
    # Bounds around friction [N]; do not trust them while a flag other than ``OUTSIDE`` or ``OFFSET_UNKNOWN`` is set
    lower_n: float
    upper_n: float
    flags: int  # Bits of ``Flag``
