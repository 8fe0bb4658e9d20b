import numpy as np
import pytest

from cylinder_friction.recordings.columns import QUANTITIES
from cylinder_friction.recordings.mapping.channel_mapping import to_column_unit, units_agree
from cylinder_friction.recordings.recording import RecordingError

OWN = {"time": "s", "pressure": "Pa", "length": "m", "force": "N", "temperature": "°C"}


@pytest.mark.parametrize("column", QUANTITIES)
def test_own_unit_leaves_values_untouched(column: str) -> None:
    values = np.array([1.0 / 3.0, -0.0, np.nan])
    assert to_column_unit(values, OWN[QUANTITIES[column]], column) is values


@pytest.mark.parametrize(
    ("column", "value", "unit", "expected"),
    [
        ("pressure_1_pa", 14.503773773, "psi", 1e5),
        *[("pressure_1_pa", 14.503773773, text, 1e5) for text in ("PSI", "psig", "psia", "psi (abs)", "psi gauge")],
        *[("pressure_1_pa", 1.0, text, 98066.5) for text in ("kgf/cm2", "kgf/cm^2")],
        *[("pressure_1_pa", 1.0, text, 1e6) for text in ("N/mm²", "MPa", "MPA")],
        *[
            ("pressure_1_pa", 3.0, text, 3e5)
            for text in ("bar", "[bar]", "BAR", " bar ", "(bar)", "barg", "bara", "bar(a)")
        ],
        ("position_m", 10.0, "in", 0.254),
        *[("position_m", 250.0, text, 0.25) for text in ("mm", "mm ", "MM", "[ mm ]", '"mm"')],
        ("position_m", 250.0, "µm", 250e-6),
        ("time_s", 1500.0, "us", 1.5e-3),
        *[("time_s", 17.3, text, 17.3) for text in ("sec", "Sek", "S", "seconds")],
        ("load_force_n", 1.0, "kip", 4448.2216152605),
        ("drive_force_n", 1.0, "lbf", 4.4482216152605),
        ("load_force_n", 1.0, "t", 9806.65),
        ("oil_temperature_c", 32.0, "degF", 0.0),
        ("oil_temperature_c", 212.0, "°F", 100.0),
        *[("oil_temperature_c", 17.3, text, 17.3) for text in ("degC", "deg C", "℃", "Celsius", "C")],
    ],
)
def test_conversion_of_every_spelling(column: str, value: float, unit: str, expected: float) -> None:
    assert to_column_unit(np.array([value]), unit, column)[0] == pytest.approx(expected, rel=1e-9, abs=1e-12)


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
