"""The schema of a recording: every measured column, what it measures and its unit."""

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
COVERAGE_FACTOR = 2.0  # Expanded over standard uncertainty, for a confidence of about 95 % (JCGM 100:2008, 6.3.3)

ALL_CONDITIONS = "all"  # Name that stands for all operating conditions together

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
