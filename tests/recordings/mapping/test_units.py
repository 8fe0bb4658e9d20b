import numpy as np
import pytest

from cylinder_friction.recordings.columns import QUANTITIES
from cylinder_friction.recordings.mapping.units import check_unit, to_column_unit, units_agree
from cylinder_friction.recordings.recording import RecordingError

OWN = {"time": "s", "pressure": "Pa", "length": "m", "force": "N", "temperature": "°C"}


@pytest.mark.parametrize("column", QUANTITIES)
def test_own_unit_leaves_values_untouched(column: str) -> None:
    values = np.array([1.0 / 3.0, -0.0, np.nan])
    assert to_column_unit(values, OWN[QUANTITIES[column]], column) is values


@pytest.mark.parametrize(
    ("value", "unit", "column", "expected"),
    [
        (14.503773773, "psi", "pressure_1_pa", 1e5),
        (1.0, "kgf/cm2", "pressure_1_pa", 98066.5),
        (1.0, "N/mm²", "pressure_1_pa", 1e6),
        (10.0, "in", "position_m", 0.254),
        (250.0, "mm", "position_m", 0.25),
        (250.0, "µm", "position_m", 250e-6),
        (3.0, "bar", "pressure_1_pa", 3e5),
        (1500.0, "us", "time_s", 1.5e-3),
        (1.0, "kip", "load_force_n", 4448.2216152605),
        (1.0, "lbf", "drive_force_n", 4.4482216152605),
        (1.0, "t", "load_force_n", 9806.65),
        (32.0, "degF", "oil_temperature_c", 0.0),
        (212.0, "°F", "oil_temperature_c", 100.0),
    ],
)
def test_conversion(value: float, unit: str, column: str, expected: float) -> None:
    assert to_column_unit(np.array([value]), unit, column)[0] == pytest.approx(expected, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize(
    ("column", "spelled", "plain"),
    [
        *[("pressure_1_pa", text, "bar") for text in ("[bar]", "BAR", " bar ", "(bar)", "barg", "bara", "bar(a)")],
        *[("pressure_1_pa", text, "psi") for text in ("PSI", "psig", "psia", "psi (abs)", "psi gauge")],
        ("pressure_1_pa", "MPA", "MPa"),
        ("pressure_1_pa", "kgf/cm^2", "kgf/cm2"),
        *[("time_s", text, "s") for text in ("sec", "Sek", "S", "seconds")],
        *[("position_m", text, "mm") for text in ("mm ", "MM", "[ mm ]", '"mm"')],
        *[("oil_temperature_c", text, "°C") for text in ("degC", "deg C", "℃", "Celsius", "C")],
    ],
)
def test_loggers_spellings(column: str, spelled: str, plain: str) -> None:
    check_unit(column, spelled)
    values = np.array([1.0, 17.3])
    np.testing.assert_array_equal(to_column_unit(values, spelled, column), to_column_unit(values, plain, column))


@pytest.mark.parametrize(
    ("column", "unit", "message"),
    [
        ("pressure_1_pa", "foo", r"'pressure_1_pa': unit 'foo' is not known; expected one of Pa, kPa, MPa, bar,"),
        ("position_m", "bar", r"'position_m': unit 'bar' measures pressure, .* holds a length; expected one of m,"),
        ("position_m", "mA", r"'mA' is a sensor's electrical signal, .* state the sensor: \{range"),
        ("pressure_1_pa", "mPa", r"unit 'mPa' is millipascal; write MPa for megapascal"),
        ("oil_temperature_c", "delta_degC", "is not known; expected one of °C, K, °F"),
        ("time_s", "", "unit '' is not known"),
    ],
)
def test_wrong_unit_is_refused(column: str, unit: str, message: str) -> None:
    with pytest.raises(RecordingError, match=message):
        check_unit(column, unit)
    with pytest.raises(RecordingError, match=message):
        to_column_unit(np.array([1.0]), unit, column)


@pytest.mark.parametrize(
    ("stated", "configured", "agree"),
    [
        ("[Bar]", "bar", True),
        ("bara", "bar", True),  # what pressure is counted from is another question
        ("MPa", "bar", False),
        ("N/mm2", "MPa", True),
        ("V", "bar", False),
        ("counts", "count", True),
        ("A", "bar", True),  # port A
        ("rod", "bar", True),  # a side
        ("-", "bar", True),
        ("", "mm", True),
    ],
)
def test_what_a_file_states_against_what_is_configured(stated: str, configured: str, agree: bool) -> None:
    assert units_agree(stated, configured) is agree
