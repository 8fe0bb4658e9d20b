"""First mappings: right where the file tells, marked where it does not, and always YAML."""

from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import yaml

from cylinder_friction.recordings.formats.format import LoggedTable
from cylinder_friction.recordings.formats.reading import read_logged_file
from cylinder_friction.recordings.logs import NameRules
from cylinder_friction.recordings.mapping.channel_mapping import ChannelMapping, SensorScale, units_agree
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
    assert set(loaded) >= {"defaults", "source", "pattern", "name_pattern", "channels"}
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
    ("timestamp", "cap_pressure", "rod_pressure", "stroke"),
    ("X_Value", "Pressure A", "Pressure B", "Displacement"),
    ("t_s", "jib_pA_cyl_bar", "jib_pB_cyl_bar", "x_p"),
    ("Time", "PistonPressure", "Kolbenstangendruck", "s [mm]"),
    ("Time [s]", "Head end [bar]", "Rod end [bar]", "Position [mm]"),
    ("Time [s]", "Cap [bar]", "Head [bar]", "Position [mm]"),
    ("时间（秒）", "无杆腔压力 [bar]", "有杆腔压力【bar】", "位移（毫米）"),
    ("Время, с", "Давление в поршневой (бар)", "Давление в штоковой (бар)", "Положение (мм)"),
    ("Time [s]", "AI1/2 p_A [bar]", "AI1/3 p_B [bar]", "s_2 [mm]"),
    ("Time [s]", "Ch 2 Pressure B bore [bar]", "P1 rod (port A) [bar]", "x [mm]"),
    ("Time (s)", "Pressure bore (bar)", "Pressure annulus (bar)", "Piston position (mm)"),
]


@pytest.mark.parametrize("names", NAMINGS)
@pytest.mark.parametrize("turned", [False, True])
def test_usual_names_are_understood_in_any_order(names: tuple[str, str, str, str], turned: bool) -> None:
    values = dict(zip(names, (TIME, 20.0 + STROKE, 10.0 + STROKE, 200.0 * STROKE), strict=True))
    text = text_of(dict(reversed(values.items())) if turned else values)
    columns = ("time_s", "pressure_1_pa", "pressure_2_pa", "position_m")
    assert names_of(text) == dict(zip(columns, names, strict=True))
    assert "which side" not in text
    for column, unit in zip(columns, ("s", "bar", "bar", "mm"), strict=True):
        assert units_agree(channels_of(text)[column]["unit"].split()[0], unit)
    for entry in channels_of(text).values():
        ChannelMapping.from_dict(entry)


P1, P2, X = 20 + STROKE, 9 + STROKE, 200 * STROKE
PAIR = {"t": TIME, "p1": P1, "p2": P2, "x": X}
SCALED = {
    "t": "t (2ms)|t_0.1ms|t (x2 s)|time 1/1000 s|Zeit in 10 ms",
    "p1": "10*p_A [bar]|p_Ax10 [bar]|p_A [bar] (scale 0.5)|p_A (0.1bar)|p_A (kPa*100)|p_A [bar] *10|p_A (bar, x10)",
    "x": "s_2mm|s_mm_x2|s*2 [mm]|s x 0.1 [mm]|s/2 [mm]",
}


@pytest.mark.parametrize(("name", "key"), [(name, key) for key, names in SCALED.items() for name in names.split("|")])
def test_a_factor_in_a_name_makes_a_unit_that_is_not_known(name: str, key: str) -> None:
    text = text_of({name if own == key else own: values for own, values in PAIR.items()})
    assert f"{name!r} states the unit " in text


TWO_CYLINDERS = {"t_s": TIME} | {
    f"{name}_{channel}": number * values
    for number, name in ((1, "main"), (2, "jib"))
    for channel, values in (("pA_cyl_bar", P1), ("pB_cyl_bar", P2), ("x_m", 0.5 * STROKE))
}
CRANE = {"Name": 2000.0 * TIME, "JibPaDCV": 2 * P1, "JibPbDCV": 2 * P1, "JibXRef": 0.5 * STROKE, "Ps": 7 * P1}
JIB, JIB_APART = ("JibPaCyl", "JibPbCyl", "JibPistonPosition"), ("Jib Pa Cyl", "Jib Pb Cyl", "Jib Piston Position")
PORTS = {"t": TIME, "P [bar]": 7 * P1, "T [bar]": 0.1 * P1, "A [bar]": P1, "B [bar]": P2, "x": X}
TAGS = {"t": TIME, "Cyl/pA": P1, "Cyl/pB": P2, "Press.Pos_mm": X}
BY_ORDER = {"t": TIME, "AI0 [bar]": P1, "AI1 [bar]": P2, "AI2 [mm]": X}


@pytest.mark.parametrize(
    ("channels", "found", "words"),
    [
        (TWO_CYLINDERS, list(TWO_CYLINDERS)[:4], "AMBIGUOUS: main_pA_cyl_bar (values 20 to 21) or jib_pA_cyl_bar"),
        (TAGS, list(TAGS), "name means pressure, piston side"),
        (PORTS, ["t", "A [bar]", "B [bar]", "x"], "name means piston side"),
        (BY_ORDER, list(BY_ORDER), "CHECK: which side it is was guessed from the order"),
        ({"t": TIME, "Force [N]": X, "pos [mm]": X}, ["t", "Force [N]", "pos [mm]"], "the force stands in"),
        (PAIR | {"Load cell [kN]": X}, [*PAIR, "Load cell [kN]"], "it must be positive when it resists extension"),
        (PAIR | {"Friction [N]": X}, list(PAIR), "#   Friction [N]"),
        *[(CRANE | dict(zip(each, (P1, P2, STROKE), strict=True)), ["Name", *each], "") for each in (JIB, JIB_APART)],
        ({"column_1": CRANE["Name"], "y": STROKE}, ["column_1", *["NOT FOUND"] * 3], "#   y: values 0 to 1"),
        (PAIR | {"p2": "", "pB [furlong]": P2}, ["t", "p1", "NOT FOUND", "x"], "'pB [furlong]' states the unit 'furl"),
    ],
)
def test_columns_are_found_and_doubts_marked(channels: dict[str, Any], found: list[str], words: str) -> None:
    """The ports of a crane's PLC are Pa and Pb, at the cylinder and at the valve."""
    text = text_of(channels)
    assert list(names_of(text).values()) == found
    assert words in text


def test_units_are_taken_from_the_file_or_guessed_and_signals_get_a_sensor_to_fill_in() -> None:
    values = {"t": 1e3 * TIME, "p1": 40.0 * STROKE, "p2": 30.0 * STROKE, "x": 0.2 * STROKE}
    text = text_of(values, {"t": "ms", "p1": "MPa"})
    assert [entry["unit"] for entry in channels_of(text).values()] == ["ms", "MPa", "bar or psi or MPa", "m"]
    assert "unit MPa as stated" in comment_of(text, "pressure_1_pa")
    assert "values 0 to 30 fit MPa" in comment_of(text, "pressure_2_pa")
    assert "CHECK: the unit is stated nowhere; bar or psi would fit too" in comment_of(text, "pressure_2_pa")
    assert channels_of(text_of(PAIR | {"p1": "", "abs(pA) [bar]": P1}))["pressure_1_pa"]["unit"] == "bar"
    assert "'pA [bar]' states the unit 'psi or bar'" in text_of({"pA [bar]": P1}, {"pA [bar]": "psi"})
    text = text_of({"t": TIME, "p_abs_A [bar]": P1, "Absolutdruck B [psi]": P2, "x [mm]": X})
    assert [entry["unit"] for entry in channels_of(text).values()] == ["s", "bar abs", "psi abs", "mm"]
    text = text_of(values, {"p1": "V", "p2": "mA"})
    one, other = (ChannelMapping.from_dict(channels_of(text)[f"pressure_{side}_pa"]).sensor for side in (1, 2))
    assert one == SensorScale((0, 1), "bar", (0, 10))
    assert other == SensorScale((0, 1), "bar", (4, 20))
    assert "NOT FOUND: the sensor's range" in comment_of(text, "pressure_1_pa")


DATES = pd.Timestamp("2026-03-14 08:15") + pd.to_timedelta(np.arange(ROWS) // 200, "s")
MEASURED = {"p1 [bar]": P1, "p2 [bar]": P2, "x [mm]": X}
TEXT = np.array(["soon"] * ROWS, dtype=object)


@pytest.mark.parametrize(
    ("clocks", "words"),
    [
        ({"column_1": np.arange(ROWS)}, "'column_1' steps by exactly 1, so that it may count rows, and not time; stat"),
        ({"Time": np.arange(ROWS)}, "'Time' steps by exactly 1, so that it may count rows"),
        (MEASURED | {"energy": TIME}, "NOT FOUND"),
        ({"Time [jiffies]": TIME}, "'Time [jiffies]' states the unit 'jiffies', which is none of time; expected"),
        ({"Sample": np.arange(ROWS), "Time": TEXT}, "'Time' is named like time, but its cells cannot be read, such as"),
        ({"n": 0.005 * np.arange(ROWS), "Uhrzeit": TEXT}, "'Uhrzeit' is named like time, but its cells cannot be read"),
    ],
)
def test_time_is_asked_for_rather_than_taken_from_what_rises(clocks: dict[str, Any], words: str) -> None:
    text = text_of(clocks | MEASURED)
    assert names_of(text)["time_s"] == "NOT FOUND"
    assert words in comment_of(text, "time_s")


@pytest.mark.parametrize(
    ("clocks", "given", "entry"),
    [
        ({"Sample": np.arange(ROWS), "Time": TIME}, "", {"channel": "Time", "unit": "s"}),
        ({"Sample": np.arange(ROWS), "t [ms]": np.arange(ROWS)}, "", {"channel": "t [ms]", "unit": "ms"}),
        ({"ElapsedTicks": 123456789 + 50_000 * np.arange(ROWS)}, "", {"channel": "ElapsedTicks", "unit": "100ns"}),
        ({"t": 5 * np.arange(ROWS)}, "", {"channel": "t", "unit": "ms or another unit"}),
        ({"ticks": 5 * np.arange(ROWS)}, "", {"channel": "ticks", "unit": "ms or another unit"}),
        ({"elapsedMillis": 5 * np.arange(ROWS)}, "", {"channel": "elapsedMillis", "unit": "millis"}),
        ({"Time": np.arange(ROWS) // 200, "ms": 5 * np.arange(ROWS) % 1000}, "s", {"channel": "Time", "unit": "s"}),
        ({"PC time": DATES, "t [ms]": 5 * np.arange(ROWS)}, "", {"channel": "t [ms]", "unit": "ms"}),
        ({"Time": TIME / 60.0}, "", {"channel": "Time", "unit": "s or min"}),
        ({"Time": TIME / 3600.0}, "", {"channel": "Time", "unit": "d or h"}),
        ({"Time": np.round(TIME, 1), "flow": STROKE}, "", {"channel": "Time", "unit": "s"}),
        ({"Sekunden seit Mitternacht": np.arange(ROWS)}, "ms", {"channel": "Sekunden seit Mitternacht", "unit": "ms"}),
        ({"column_1": np.arange(ROWS)}, "ms", {"channel": "NOT FOUND", "unit": "s"}),
        ({"column_1": np.arange(ROWS)}, "1 kHz", {"rate_hz": 1000}),
    ],
)
def test_a_clock_is_told_from_a_count(clocks: dict[str, Any], given: str, entry: dict[str, Any]) -> None:
    """What steps by 1 is time if its name and a given unit state it; a given rate takes the place of a clock."""
    table = LoggedTable(pd.DataFrame(clocks | MEASURED))
    guess = guess_mapping([table], PATH, units={"time": given} if given else None)
    assert channels_of(mapping_yaml(guess))["time_s"] == entry


def test_one_row_per_value_is_named_with_its_pivot() -> None:
    tags = np.array(["pA", "pB", "Weg"] * 100, dtype=object)
    table = pd.DataFrame({"Tag": tags, "Zeit": np.repeat(TIME[:100], 3), "Wert": np.tile([7.0, 9.0, 75.0], 100)})
    words = r"one row per value: 'Tag' names 'pA', 'pB', 'Weg' in turn, and 'Wert' holds .*pivot\(index='Zeit', colu"
    with pytest.raises(RecordingError, match=words):
        guess_mapping([LoggedTable(table)], PATH)


def test_a_position_in_percent_is_one_of_the_stroke() -> None:
    found = channels_of(text_of({"t": TIME, "p1": 20 + STROKE, "p2": 9 + STROKE, "position [%]": 100 * STROKE}))
    assert found["position_m"] == {"channel": "position [%]", "unit": "%"}
    mapped = ChannelMapping.from_dict(found["position_m"]).for_stroke("position_m", 0.25)
    np.testing.assert_allclose(mapped.column_values(np.array([0.0, 30.0, 100.0]), "position_m"), [0.0, 0.075, 0.25])


def test_a_table_is_named_where_a_channel_is_in_several() -> None:
    one = LoggedTable(pd.DataFrame({"Name": TIME, "p1": 20 + STROKE, "p2": 9 + STROKE}), name="group 1")
    two = LoggedTable(pd.DataFrame({"Name": TIME[::2], "x": 200 * STROKE[::2], "p1": TIME[::2]}), name="group 2")
    found = channels_of(mapping_yaml(guess_mapping([one, two], PATH)))
    assert found["time_s"] == {"channel": "Name", "unit": "s"}
    assert found["pressure_1_pa"] == {"channel": "p1", "unit": "bar or psi or MPa", "table": "group 1"}
    assert found["position_m"] == {"channel": "x", "unit": "mm or cm"}


def test_of_two_clocks_a_channel_has_the_one_that_ends_with_it() -> None:
    slow = {
        "Time 2 [s]": np.where(TIME < 1.0, 200.0 * TIME, np.nan),
        "Oil temp [°C]": np.where(TIME < 1.0, 40.0, np.nan),
    }
    found = channels_of(text_of(slow | {"Time 1 [s]": TIME} | MEASURED))
    assert (found["time_s"]["channel"], found["oil_temperature_c"]["time"]) == ("Time 1 [s]", "Time 2 [s]")


@pytest.mark.parametrize("turned", [False, True])
def test_of_clocks_and_channels_in_turn_each_channel_has_the_one_beside_it(turned: bool) -> None:
    clocks = {f"t{number} [s]": TIME + 0.1 * number for number in (1, 2, 3)}
    in_turn = [pair for both in zip(clocks.items(), MEASURED.items(), strict=True) for pair in both]
    text = text_of(dict(reversed(in_turn) if turned else in_turn))
    assert channels_of(text)["time_s"]["channel"] == "t1 [s]"
    assert [entry.get("time") for entry in channels_of(text).values()] == [None, None, "t2 [s]", "t3 [s]"]
    assert "AMBIGUOUS: " not in text
    del in_turn[0 if turned else -2]  # one channel has no clock beside it
    for channels in (in_turn, [in_turn[each] for each in (1, 0, 3, 2, 4)]):  # clocks behind their channels, too
        with pytest.raises(RecordingError, match="are two clocks that differ, and nothing shows which one stamps"):
            text_of(dict(channels))


@pytest.mark.parametrize("name", ["t", "p1", "x", "Value", "p_supply"])
def test_columns_of_one_name_are_refused_if_one_may_be_needed(name: str) -> None:
    channels = {key: own for key, own in PAIR.items() if key != "x" or name != "Value"}
    twice = pd.concat([pd.DataFrame(channels), pd.DataFrame({name: P1}), pd.DataFrame({name: P2})], axis=1)
    words = f"columns have the name {name!r}, so that no mapping can name one of them; give each a name of its own"
    with pytest.raises(RecordingError, match=words) if name != "p_supply" else nullcontext():
        guess_mapping([LoggedTable(twice)], PATH)


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
