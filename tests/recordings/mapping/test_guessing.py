"""First mappings: right where the file tells, marked where it does not, and always YAML."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import yaml

from cylinder_friction.recordings.conversion import NameRules
from cylinder_friction.recordings.formats.format import LoggedTable
from cylinder_friction.recordings.formats.reading import read_logged_file
from cylinder_friction.recordings.mapping.channel_mapping import ChannelMapping
from cylinder_friction.recordings.mapping.guessing import guess_mapping
from cylinder_friction.recordings.mapping.mapping_text import mapping_yaml
from cylinder_friction.recordings.recording import RecordingError

PATH = Path("logs/noload_day1.csv")
ROWS = 400
TIME = 0.005 * np.arange(ROWS)
STROKE = 0.5 - 0.5 * np.cos(2.0 * np.pi * TIME)


def text_of(channels: dict[str, Any], units: dict[str, str] | None = None, path: Path = PATH) -> str:
    return mapping_yaml(guess_mapping([LoggedTable(pd.DataFrame(channels), units or {})], path))


def channels_of(text: str) -> dict[str, Any]:
    loaded = yaml.safe_load(text)
    assert set(loaded) >= {"defaults", "source", "truth", "pattern", "name_pattern", "channels"}
    found: dict[str, Any] = loaded["channels"]
    return found


def names_of(text: str) -> dict[str, str]:
    return {column: entry["channel"] for column, entry in channels_of(text).items()}


def comment_of(text: str, column: str) -> str:
    """Return the remarks right above a column's line."""
    lines = text.splitlines()
    end = next(row for row, line in enumerate(lines) if line.startswith(f"  {column}:"))
    start = end
    while lines[start - 1].startswith("  #"):
        start -= 1
    return "\n".join(lines[start:end])


NAMINGS: list[tuple[str, str, str, str]] = [
    ("Time [s]", "P1 [bar]", "P2 [bar]", "Position [mm]"),
    ("t", "pA", "pB", "x"),
    ("Zeit", "Druck Kolbenseite", "Druck Stangenseite", "Weg"),
    ("timestamp", "cap_pressure", "rod_pressure", "stroke"),
    ("X_Value", "Pressure A", "Pressure B", "Displacement"),
    ("t_s", "jib_pA_cyl_bar", "jib_pB_cyl_bar", "x_p"),
    ("Time", "PistonPressure", "Kolbenstangendruck", "s [mm]"),
    ("Time (s)", "Pressure bore (bar)", "Pressure annulus (bar)", "Piston position (mm)"),
]


@pytest.mark.parametrize("names", NAMINGS)
@pytest.mark.parametrize("turned", [False, True])
def test_usual_names_are_understood_in_any_order(names: tuple[str, str, str, str], turned: bool) -> None:
    values = dict(zip(names, (TIME, 20.0 + STROKE, 10.0 + STROKE, 200.0 * STROKE), strict=True))
    text = text_of(dict(reversed(values.items())) if turned else values)
    columns = ("time_s", "pressure_1_pa", "pressure_2_pa", "position_m")
    assert names_of(text) == dict(zip(columns, names, strict=True))
    assert [channels_of(text)[column]["unit"] for column in columns] == ["s", "bar", "bar", "mm"]
    for entry in channels_of(text).values():
        ChannelMapping.from_dict(entry)


def test_units_of_the_file_are_taken_and_missing_ones_guessed_with_alternatives() -> None:
    values = {"t": 5.0 * np.arange(ROWS), "p1": 40.0 * STROKE, "p2": 30.0 * STROKE, "x": 0.2 * STROKE}
    text = text_of(values, {"p1": "MPa"})
    units = {column: entry["unit"] for column, entry in channels_of(text).items()}
    assert units == {"time_s": "ms", "pressure_1_pa": "MPa", "pressure_2_pa": "MPa", "position_m": "m"}
    assert "unit MPa from the file" in comment_of(text, "pressure_1_pa")
    assert "values 0 to 30 fit MPa" in comment_of(text, "pressure_2_pa")
    assert "CHECK: the unit is stated nowhere; bar or psi would fit too" in comment_of(text, "pressure_2_pa")


def test_two_cylinders_in_one_file_stay_apart_and_are_marked() -> None:
    channels = {"t_s": TIME}
    for number, cylinder in enumerate(("main", "jib"), start=1):
        for channel, values in (("pA_cyl_bar", 20 + STROKE), ("pB_cyl_bar", 9 + STROKE), ("x_m", 0.5 * STROKE)):
            channels[f"{cylinder}_{channel}"] = number * values
    text = text_of(channels)
    found = names_of(text)
    assert {name.split("_")[0] for column, name in found.items() if column != "time_s"} == {"main"}
    assert "AMBIGUOUS: main_pA_cyl_bar (values 20 to 21) or jib_pA_cyl_bar (values 40 to 42)" in text
    assert "AMBIGUOUS: main_x_m (values 0 to 0.5) or jib_x_m" in text


MEASURED = {"p1 [bar]": 20 + STROKE, "p2 [bar]": 9 + STROKE, "x [mm]": 200 * STROKE}
TEXT = np.array(["soon"] * ROWS, dtype=object)


@pytest.mark.parametrize(
    ("clocks", "words"),
    [
        ({"column_1": np.arange(ROWS)}, "'column_1' steps by exactly 1, so that it may count rows, and not time; stat"),
        ({"Time": np.arange(ROWS)}, "'Time' steps by exactly 1, so that it may count rows"),
        (MEASURED | {"energy": TIME}, "NOT FOUND"),
        ({"Sample": np.arange(ROWS), "Time": TEXT}, "'Time' is named like time, but its cells cannot be read, such as"),
        ({"n": 0.005 * np.arange(ROWS), "Uhrzeit": TEXT}, "'Uhrzeit' is named like time, but its cells cannot be read"),
    ],
)
def test_time_is_asked_for_rather_than_taken_from_what_rises(clocks: dict[str, Any], words: str) -> None:
    text = text_of(clocks | MEASURED)
    assert names_of(text)["time_s"] == "NOT FOUND"
    assert words in comment_of(text, "time_s")


@pytest.mark.parametrize(
    ("clocks", "channel", "unit"),
    [
        ({"Sample": np.arange(ROWS), "Time": TIME}, "Time", "s"),
        ({"Sample": np.arange(ROWS), "t [ms]": np.arange(ROWS)}, "t [ms]", "ms"),
        ({"ElapsedTicks": 123456789 + 50_000 * np.arange(ROWS)}, "ElapsedTicks", "100ns"),
        ({"ticks": 5 * np.arange(ROWS)}, "ticks", "ms"),
        ({"Time": np.round(TIME, 1), "flow": STROKE}, "Time", "s"),
    ],
)
def test_a_clock_is_told_from_a_count(clocks: dict[str, Any], channel: str, unit: str) -> None:
    found = channels_of(text_of(clocks | MEASURED))["time_s"]
    assert (found["channel"], found["unit"]) == (channel, unit)


def test_one_row_per_value_is_named_with_its_pivot() -> None:
    tags = np.array(["pA", "pB", "Weg"] * 100, dtype=object)
    table = pd.DataFrame({"Tag": tags, "Zeit": np.repeat(TIME[:100], 3), "Wert": np.tile([7.0, 9.0, 75.0], 100)})
    words = (
        r"one row per value: 'Tag' names 'pA', 'pB', 'Weg' in turn, and 'Wert' holds .*pivot\(index='Zeit', columns='Ta"
    )
    with pytest.raises(RecordingError, match=words):
        guess_mapping([LoggedTable(table)], PATH)


def test_what_steps_by_one_is_time_if_its_name_and_a_given_unit_state_it() -> None:
    tables = [LoggedTable(pd.DataFrame({name: np.arange(ROWS)} | MEASURED)) for name in ("Time", "column_1")]
    named, unnamed = (guess_mapping([table], PATH, units={"time": "ms"}).columns["time_s"] for table in tables)
    assert (named.known, named.unit, unnamed.known) == (True, "ms", False)


@pytest.mark.parametrize(("given", "rate_hz"), [("200Hz", 200), ("1 kHz", 1000)])
def test_a_given_rate_takes_the_place_of_a_clock(given: str, rate_hz: float) -> None:
    table = LoggedTable(pd.DataFrame({"column_1": np.arange(ROWS)} | MEASURED))
    guess = guess_mapping([table], PATH, units={"time": given})
    assert channels_of(mapping_yaml(guess))["time_s"] == {"rate_hz": rate_hz}


def test_a_position_in_percent_is_one_of_the_stroke() -> None:
    found = channels_of(text_of({"t": TIME, "p1": 20 + STROKE, "p2": 9 + STROKE, "position [%]": 100 * STROKE}))
    assert found["position_m"] == {"channel": "position [%]", "unit": "%"}
    mapped = ChannelMapping.from_dict(found["position_m"]).for_stroke("position_m", 0.25)
    np.testing.assert_allclose(mapped.column_values(np.array([0.0, 30.0, 100.0]), "position_m"), [0.0, 0.075, 0.25])


def test_what_is_not_there_is_marked_and_all_channels_are_listed() -> None:
    text = text_of({"column_1": 10.0 * np.arange(ROWS), "column_2": STROKE, "column_3": 3.0 * STROKE})
    columns = ("time_s", "pressure_1_pa", "pressure_2_pa", "position_m")
    assert names_of(text) == dict(zip(columns, ("column_1", *["NOT FOUND"] * 3), strict=True))
    assert "# NOT FOUND: name the channel" in comment_of(text, "pressure_1_pa")
    assert "#   column_3: values 0 to 3" in text


def test_pressures_that_do_not_say_their_side_are_taken_in_order_and_marked() -> None:
    text = text_of({"t": TIME, "AI0 [bar]": 20 + STROKE, "AI1 [bar]": 9 + STROKE, "AI2 [mm]": 200 * STROKE})
    assert list(names_of(text).values()) == ["t", "AI0 [bar]", "AI1 [bar]", "AI2 [mm]"]
    assert "CHECK: which side it is was guessed from the order" in comment_of(text, "pressure_1_pa")


def test_a_force_stands_in_where_there_is_no_pressure_and_is_a_load_where_there_is() -> None:
    alone = names_of(text_of({"t": TIME, "Force [N]": 300 * STROKE, "pos [mm]": 200 * STROKE}))
    assert alone == {"time_s": "t", "drive_force_n": "Force [N]", "position_m": "pos [mm]"}
    both = {"t": TIME, "p1": 20 + STROKE, "p2": 9 + STROKE, "x": 200 * STROKE, "Load cell [kN]": STROKE}
    assert names_of(text_of(both))["load_force_n"] == "Load cell [kN]"


def test_electrical_signals_get_a_sensor_to_fill_in() -> None:
    text = text_of({"t": TIME, "p1 [V]": STROKE, "p2 [mA]": 4 + STROKE, "x [mm]": 200 * STROKE})
    found = channels_of(text)
    assert found["pressure_1_pa"]["sensor"] == {"range": [0, 1], "unit": "bar", "signal": [0, 10]}
    assert found["pressure_2_pa"]["sensor"]["signal"] == [4, 20]
    assert "NOT FOUND: the sensor's range" in comment_of(text, "pressure_1_pa")
    for entry in found.values():
        ChannelMapping.from_dict(entry)


def test_a_table_is_named_where_a_channel_is_in_several() -> None:
    one = LoggedTable(pd.DataFrame({"Name": TIME, "p1": 20 + STROKE, "p2": 9 + STROKE}), name="group 1")
    two = LoggedTable(pd.DataFrame({"Name": TIME[::2], "x": 200 * STROKE[::2], "p1": TIME[::2]}), name="group 2")
    found = channels_of(mapping_yaml(guess_mapping([one, two], PATH)))
    assert found["time_s"] == {"channel": "Name", "unit": "s"}
    assert found["pressure_1_pa"] == {"channel": "p1", "unit": "bar", "table": "group 1"}
    assert found["position_m"] == {"channel": "x", "unit": "mm"}


@pytest.mark.parametrize(
    "names", [("JibPaCyl", "JibPbCyl", "JibPistonPosition"), ("Jib Pa Cyl", "Jib Pb Cyl", "Jib Piston Position")]
)
def test_the_ports_of_a_crane_s_plc(names: tuple[str, str, str]) -> None:
    columns = dict(zip(names, (43 + STROKE, 79 + STROKE, 0.5 * STROKE), strict=True))
    others = {"JibPaDCV": 47 + STROKE, "JibPbDCV": 47 + STROKE, "JibXRef": 0.5 * STROKE, "Ps": 150 + STROKE}
    found = names_of(text_of({"Name": 10.0 * np.arange(ROWS), **others, **columns}))
    assert found == dict(zip(("time_s", "pressure_1_pa", "pressure_2_pa", "position_m"), ("Name", *names), strict=True))


def test_the_pattern_of_names_finds_condition_and_session() -> None:
    guess = guess_mapping([LoggedTable(pd.DataFrame({"t": TIME}))], Path("logs/no-load_day1_3.csv.gz"))
    loaded = yaml.safe_load(mapping_yaml(guess))
    assert (loaded["source"], loaded["pattern"]) == ("logs", "**/*.csv.gz")
    names = NameRules(loaded["name_pattern"]).names("a/no-load_day1_3.csv.gz")
    assert (names.condition, names.session) == ("no-load", "no-load_day1_3")


@pytest.mark.parametrize("name", ["Weg: {x}", "'Weg' #1", "Weg\u2028", "Weg \\ é, [a] & *b", "Weg\x07", "yes Weg"])
def test_channels_of_any_name_are_named_exactly(name: str) -> None:
    guess = guess_mapping([LoggedTable(pd.DataFrame({name: STROKE}), {name: "mm"})], Path("logs") / "a\u2028'{b}")
    assert channels_of(mapping_yaml(guess))["position_m"]["channel"] == name


def test_a_file_of_the_rig_is_guessed_as_it_is_configured(tmp_path: Path) -> None:
    path = tmp_path / "condition1_session01_recording01.csv"
    values = {"Time [s]": TIME, "P1 [bar]": 20 + STROKE, "P2 [bar]": 9 + STROKE, "Position [mm]": 250 * STROKE}
    values["Oil temperature [degC]"] = 35.0 + 0.01 * TIME
    pd.DataFrame(values).to_csv(path, index=False)
    configured = yaml.safe_load((Path(__file__).parents[3] / "conf/ingest/rig.yaml").read_text(encoding="utf-8"))
    # What its sensors are good for stands in no file.
    without_sensors = {
        column: {key: value for key, value in entry.items() if key != "sensor"}
        for column, entry in configured["channels"].items()
    }
    text = mapping_yaml(guess_mapping(read_logged_file(path), path))
    assert channels_of(text) == without_sensors
    assert not any(mark in text.split("channels:")[1] for mark in ("AMBIGUOUS", "NOT FOUND", "CHECK"))
