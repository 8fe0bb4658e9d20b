"""The schema of a recording: every measured column, what it measures and its unit."""

from collections.abc import Collection

TIME = "time_s"
PRESSURE_1 = "pressure_1_pa"  # Piston side, gauge [Pa]
PRESSURE_2 = "pressure_2_pa"  # Rod side, gauge [Pa]
POSITION = "position_m"  # Extension positive [m]
LOAD_FORCE = "load_force_n"  # Positive when it resists extension [N]
OIL_TEMPERATURE = "oil_temperature_c"
REFERENCE_C = 40.0  # Oil temperatures that explain friction count from here [°C]
OTHER_POSITIONS = ("other_position_1_m", "other_position_2_m")
"""Positions of other cylinders [m], on which the load may also depend."""
DRIVE_FORCE = "drive_force_n"
"""Force on the piston or rod from a load cell or motor current [N], positive towards extension. It replaces
P1·A1 - P2·A2 if a cylinder has no pressure sensors."""

UNCERTAINTY_COLUMN = "friction_uncertainty_n"
"""Expanded uncertainty of a friction label [N]: ``COVERAGE_FACTOR`` times the standard uncertainty."""
COVERAGE_FACTOR = 2.0
"""Ratio of expanded to standard uncertainty, for a confidence level of about 95 % (JCGM 100:2008, 6.3.3)."""

ALL_CONDITIONS = "all"
"""Name that stands for all operating conditions together."""

PRESSURES = (PRESSURE_1, PRESSURE_2)
SAMPLE_COLUMNS = (*PRESSURES, POSITION)
"""The raw sample that every estimator sees, in this order: piston side, rod side, position."""

REQUIRED_COLUMNS = (TIME, *SAMPLE_COLUMNS)
"""Columns that a hydraulic recording needs. A recording with ``drive_force_n`` needs only time and position."""

QUANTITIES = {
    TIME: "time",
    PRESSURE_1: "pressure",
    PRESSURE_2: "pressure",
    POSITION: "length",
    LOAD_FORCE: "force",
    DRIVE_FORCE: "force",
    OIL_TEMPERATURE: "temperature",
    **dict.fromkeys(OTHER_POSITIONS, "length"),
}
"""Quantity of each measured column. Its unit is the SI unit of the quantity; temperatures are in °C."""


_SHOWN_IN = {"pa": ("bar", 1e-5), "m": ("mm", 1e3), "n": ("N", 1.0), "c": ("°C", 1.0)}


def in_shown_unit(column: str, lowest: float, highest: float) -> tuple[str, str, str, str]:
    """Return a column's description, its display unit, and two of its values in that unit, to four digits.

    Example:
        >>> from cylinder_friction.recordings.columns import in_shown_unit
        >>> in_shown_unit("pressure_1_pa", 1e5, 2.5e7)
        ('pressure 1', 'bar', '1', '250')
    """
    words = column.rpartition("_")
    unit, factor = _SHOWN_IN.get(words[2], ("", 1.0))
    return words[0].replace("_", " "), unit, f"{factor * lowest:.4g}", f"{factor * highest:.4g}"


def missing_columns(columns: Collection[str]) -> list[str]:
    """List the required columns that are missing; a drive force replaces both pressures.

    Example:
        >>> from cylinder_friction.recordings.columns import missing_columns
        >>> missing_columns(["time_s", "pressure_1_pa", "position_m"])
        ['pressure_2_pa']
        >>> missing_columns(["time_s", "drive_force_n", "position_m"])
        []
    """
    required = (TIME, POSITION) if DRIVE_FORCE in columns else REQUIRED_COLUMNS
    return [column for column in required if column not in columns]


def missing_column(columns: Collection[str]) -> str:
    """Write a sentence on the first required column that a table lacks; empty if it has all."""
    missing = missing_columns(columns)
    expected = f"{list(REQUIRED_COLUMNS)} (or {TIME}, {POSITION} and {DRIVE_FORCE})"
    got = f"got columns {list(columns)}, expected at least {expected}"
    return f"column {missing[0]!r} is missing; {got}" if missing else ""
