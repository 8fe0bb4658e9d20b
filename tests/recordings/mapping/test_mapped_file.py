import re
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.recordings.formats.format import LoggedTable
from cylinder_friction.recordings.formats.reading import read_logged_file
from cylinder_friction.recordings.mapping.channel_mapping import ChannelMapping, SensorScale, wanted_channels
from cylinder_friction.recordings.mapping.mapped_file import MappedFile, map_signals
from cylinder_friction.recordings.recording import RecordingError, Start
from cylinder_friction.recordings.timeline.aligning import align
from cylinder_friction.recordings.timeline.timestamps import TimeRules

MAPPING = {
    "time_s": ChannelMapping("t", "ms"),
    "pressure_1_pa": ChannelMapping("a", "bar"),
    "pressure_2_pa": ChannelMapping("b", "psi"),
    "position_m": ChannelMapping("x", "mm", -1),
}


def logged(name: str = "", units: dict[str, str] | None = None, **columns: Any) -> LoggedTable:
    cells = {"t": [0, 5], "a": [1.0, 2.0], "b": [0.0, 1.0], "x": [-10.0, -20.0], "spare": [0, 0]}
    return LoggedTable(pd.DataFrame(cells | columns), units or {}, name)


def table(name: str, begin: str = "", **columns: Any) -> LoggedTable:
    start = Start(np.datetime64(f"2026-03-14T{begin}"), False, "") if begin else None
    return LoggedTable(pd.DataFrame(columns), name=name, start=start)


COUNTS = ChannelMapping("a", "count", sensor=SensorScale((0.0, 10.0), "bar", (0.0, 10.0)))
AGREEING = {"a": "Bar", "b": "PSI", "x": "[mm]", "t": "msec", "spare": "MPa"}
RENAMED_TIME = LoggedTable(logged().channels.rename(columns={"t": "time"}))
OTHER_NAMES = {"time_s": ChannelMapping("t", "ms", alternatives=("time", "Name"))}


@pytest.mark.parametrize(
    ("found", "change", "pressure_pa"),
    [
        (logged(), {}, [1e5, 2e5]),
        (logged(units=AGREEING), {}, [1e5, 2e5]),
        *[(logged(units={"a": no_unit}), {}, [1e5, 2e5]) for no_unit in ("A", "rod", "-", "")],  # port A, a side
        (logged(units=AGREEING), {"time_s": ChannelMapping("t")}, [1e5, 2e5]),  # its unit stands in the file
        (logged(units={"a": "counts"}), {"pressure_1_pa": COUNTS}, [1e5, 2e5]),
        *[
            (logged(units={"a": unit}), {"pressure_1_pa": ChannelMapping("a", unit)}, [1e5 - 101325.0, 2e5 - 101325.0])
            for unit in ("bara", "bar absolute", "absolute bar", "[abs. bar]")
        ],
        (logged(), OTHER_NAMES, [1e5, 2e5]),
        (RENAMED_TIME, OTHER_NAMES, [1e5, 2e5]),
    ],
)
def test_mapped_channels_are_in_si_units_and_spare_ones_left_out(
    found: LoggedTable, change: dict[str, ChannelMapping], pressure_pa: list[float]
) -> None:
    mapped = map_signals([replace(found, notes=("the last line was cut off",))], MAPPING | change)
    assert set(mapped.signals) == {"pressure_1_pa", "pressure_2_pa", "position_m"}
    assert mapped.notes == ("the last line was cut off",)
    np.testing.assert_allclose(mapped.signals["pressure_1_pa"].values, pressure_pa)
    np.testing.assert_allclose(mapped.signals["position_m"].values, [0.01, 0.02])
    np.testing.assert_allclose(mapped.signals["position_m"].time_s, [0.0, 0.005])


@pytest.mark.parametrize(("delay_s", "first"), [(0.02, 0), (0.0125, 1)])
def test_a_sensor_of_a_stated_delay_is_moved_and_the_others_are_not(delay_s: float, first: int) -> None:
    """The load cell shows a sine late; what is logged beside it stays as it was, sample by sample."""
    time_s = 0.005 * np.arange(2000)
    late = 10.0 * np.sin(3.0 * (time_s - delay_s))
    cell = ChannelMapping("f", "N", sensor=SensorScale(delay_s=delay_s))
    others = {name: np.cos(5.0 * time_s) for name in "abx"}
    mapped = map_signals([table("", t=1e3 * time_s, f=late, **others)], MAPPING | {"load_force_n": cell})
    assert mapped.notes == (f"load_force_n: moved {1e3 * delay_s:g} ms earlier, the delay stated for its sensor",)
    (piece,) = align(mapped.signals, TimeRules())
    found = piece.columns
    assert len(found["time_s"]) == len(time_s) - 4
    np.testing.assert_allclose(found["time_s"], time_s[first:][: len(found["time_s"])], atol=1e-9)
    np.testing.assert_allclose(found["load_force_n"], 10.0 * np.sin(3.0 * found["time_s"]), atol=2e-3)
    np.testing.assert_array_equal(found["pressure_1_pa"], 1e5 * others["a"][first:][: len(found["time_s"])])


FAST = {"t": np.arange(6) * 5.0, "a": np.ones(6), "b": np.ones(6)}
SLOW = {"t": np.arange(3) * 10.0, "x": np.zeros(3)}


OTHER_CLOCK = LoggedTable(pd.DataFrame({"t2": [0.0, 0.01, 0.02], "x": np.zeros(3)}), {"t2": "s"}, "slow")


@pytest.mark.parametrize(("slow", "time"), [(table("slow", **SLOW), None), (OTHER_CLOCK, "t2")])
def test_each_table_keeps_its_own_time(slow: LoggedTable, time: str | None) -> None:
    mapping = MAPPING | {"position_m": ChannelMapping("x", "mm", time=time)}
    signals = map_signals([table("fast", **FAST), slow], mapping).signals
    np.testing.assert_allclose(signals["pressure_1_pa"].time_s, np.arange(6) * 0.005)
    np.testing.assert_allclose(signals["position_m"].time_s, np.arange(3) * 0.01)


ROWS = np.arange(40)
PLC = {"t": 5 * ROWS, "t10 [ms]": 10 * ROWS, "a": np.ones(40), "b": np.ones(40), "x": np.zeros(40)}


def test_two_clocks_of_one_table_are_refused_unless_each_column_states_its_own() -> None:
    tables = [LoggedTable(pd.DataFrame(PLC), {"t10 [ms]": "ms"})]
    words = "two clocks, 't' with 200 Hz and 't10 [ms]' with 100 Hz, and no column is stamped by 't10 [ms]'"
    with pytest.raises(RecordingError, match=re.escape(words)):
        map_signals(tables, MAPPING)
    map_signals([replace(tables[0], master="t")], MAPPING)  # as the file itself states
    ended = tables[0].channels["t10 [ms]"].where(ROWS < 20)  # it stamps a slower channel, which is not mapped
    slower = replace(tables[0], channels=tables[0].channels.assign(**{"t10 [ms]": ended}))
    map_signals([slower], MAPPING)
    with pytest.raises(RecordingError, match=re.escape(words)):  # position is as short
        map_signals([replace(slower, channels=slower.channels.assign(x=np.where(ROWS < 15, 1.0, np.nan)))], MAPPING)
    mapping = MAPPING | {"position_m": ChannelMapping("x", "mm", time="t10 [ms]")}
    assert map_signals(tables, mapping).signals["position_m"].time_s[-1] == 0.39
    in_seconds = MAPPING | {"position_m": ChannelMapping("x", "mm", time="t10 [ms]", time_unit="s")}
    tables = [LoggedTable(pd.DataFrame(PLC | {"t10 [ms]": 0.005 * ROWS}))]
    assert map_signals(tables, in_seconds).signals["position_m"].time_s[-1] == pytest.approx(0.195)
    alike = {name: cells for name, cells in PLC.items() if name != "t10 [ms]"}
    coarse_dates = pd.Timestamp("2026-03-14") + pd.to_timedelta(ROWS // 2 * 10, "ms")
    for clock in (5000 * ROWS, 0.005 * ROWS, ROWS, coarse_dates):
        start = map_signals([LoggedTable(pd.DataFrame(alike | {"clock": clock}))], MAPPING).start
        assert (start and start.text()) == ("2026-03-14T00:00:00.000" if clock is coarse_dates else None)


@pytest.mark.parametrize(("end", "left_out"), [(np.nan, 0), ("Err", 1)])
def test_oil_temperature_is_held_between_its_values_or_left_out(end: Any, left_out: int) -> None:
    oil = [*[40.0, *[end] * 14] * 2, 40.0, *[end] * 9] if not left_out else [*[40.0] * 30, *[end] * 10]
    tables = [LoggedTable(pd.DataFrame({**PLC, "oil": oil}).drop(columns="t10 [ms]"))]
    mapped = map_signals(tables, MAPPING | {"oil_temperature_c": ChannelMapping("oil", "degC")})
    assert mapped.notes == ("oil_temperature_c: left out, because 10 of 40 rows have no value in a row",) * left_out
    assert left_out or np.all(mapped.signals["oil_temperature_c"].values == 40.0)


@pytest.mark.parametrize("name", ["t", "Time_ms"])
def test_numbers_since_a_known_date_are_dates_unless_another_unit_is_stated(tmp_path: Path, name: str) -> None:
    def read(channel: str, stamps: Any, unit: str) -> MappedFile:
        pd.DataFrame({**PLC, "t10 [ms]": 0, "t": stamps}).rename(columns={"t": channel}).to_csv(tmp_path / "log.csv")
        mapping = MAPPING | {"time_s": ChannelMapping(channel, unit)}
        return map_signals(read_logged_file(tmp_path / "log.csv", wanted=wanted_channels(mapping)), mapping)

    for unit in ("ms", "s"):  # a log has no 56,000 years
        mapped = read(name, 1_773_476_100_000 + 5 * ROWS, unit)
        assert mapped.start is not None
        assert mapped.start.text() == "2026-03-14T08:15:00.000Z"
        np.testing.assert_array_equal(mapped.signals["position_m"].time_s, 5 * ROWS / 1e3)
    for channel, step_s in ((f"{name} [s]", 5e-6), (name, 5e-6), (name, 0.0005)):  # in days, it would be a date, too
        stamps_s = 46_000.0 + step_s * ROWS
        np.testing.assert_array_equal(read(channel, stamps_s, "s").signals["position_m"].time_s, stamps_s)


RATE = MAPPING | {"time_s": ChannelMapping(rate_hz=200.0)}


LOST = 5.0 * np.delete(np.arange(42), [20, 21])
DATES = pd.Timestamp("2026-03-14") + pd.to_timedelta(20 * ROWS, "ms")


@pytest.mark.parametrize(
    ("name", "stamps", "unit", "logged_hz"),
    [
        ("Time [s]", 0.01 * ROWS, "s", "100"),
        ("stamp.sec", DATES, "", "50"),
        *[("t", stamps, "", "") for stamps in (LOST, ROWS, 10 * ROWS, 50000 * ROWS + 10**15)],
    ],
)
def test_a_rate_is_refused_if_time_contradicts(name: str, stamps: Any, unit: str, logged_hz: str) -> None:
    """A time without a unit, and a count of samples or ticks, contradict no rate."""
    columns = {name: stamps, "a": np.ones(40), "b": np.ones(40), "x": np.zeros(40)}
    words = f"two clocks, the stated rate with 200 Hz and {name!r} with {logged_hz} Hz, and no column is stamped by"
    with pytest.raises(RecordingError, match=re.escape(words)) if logged_hz else nullcontext():
        map_signals([LoggedTable(pd.DataFrame(columns), {name: unit} if unit else {})], RATE)


ENDING = {"t": 5.0 * np.arange(2000), "a": np.ones(2000), "b": np.ones(2000)}


@pytest.mark.parametrize(
    ("last", "step", "mapping", "refused"),
    [
        (500, 1, RATE, True),
        (1001, 1, RATE, True),
        (1000, 1, MAPPING, True),  # below one time column, half the rows show a slower channel
        *[(last, 1, MAPPING, False) for last in (1600, 1010, 1990, 2000)],  # lost at some row
        (2000, 2, MAPPING, False),  # every other sample
    ],
)
def test_columns_that_end_at_different_rows_are_refused(
    last: int, step: int, mapping: dict[str, ChannelMapping], refused: bool
) -> None:
    ending = LoggedTable(pd.DataFrame(ENDING | {"x": np.where(np.arange(2000) % step == 0, 1.0, np.nan)}))
    ending.channels.loc[last:, "x"] = np.nan
    said = f"position_m ('x') at row {last}, pressure_1_pa ('a') at row 2000; they were logged at different rates"
    faster = f"on one clock position_m would run {2000 / last:.3g} times too fast; export a time column for each rate"
    with pytest.raises(RecordingError, match=f"{re.escape(said)}.*{faster}") if refused else nullcontext():
        map_signals([ending], mapping)


def test_dates_of_two_tables_count_from_the_earliest() -> None:
    start = pd.Timestamp("2026-03-14 09:00:00.5")
    stamped = np.arange(6) != 3  # one stamp is missing
    fast = FAST | {"t": (start + pd.to_timedelta(np.arange(6) * 5 + 2, unit="ms")).where(stamped)}
    slow = SLOW | {"t": start + pd.to_timedelta(np.arange(3) * 10, unit="ms")}
    mapping = MAPPING | {"time_s": ChannelMapping("t")}
    signals = map_signals([table("fast", **fast), table("slow", **slow)], mapping).signals
    np.testing.assert_allclose(signals["position_m"].time_s, [0.0, 0.01, 0.02])
    expected_s = np.where(stamped, 0.002 + np.arange(6) * 0.005, np.nan)
    np.testing.assert_allclose(signals["pressure_1_pa"].time_s, expected_s)


DATED = FAST | {"t": pd.Timestamp("2026-03-14") + pd.to_timedelta(np.arange(6) * 5, unit="ms")}
SLOW_TIME, NO_TIME = table("slow", t2=[0.0, 1.0, 2.0], x=np.zeros(3)), table("slow", x=np.zeros(3))
BEGUN = [table("fast", "08:15:00", **FAST), table("slow", "08:15:01", **SLOW)]
STAMPED = {"position_m": ChannelMapping("x", "mm", time="t")}
RENAMED = LoggedTable(logged().channels.rename(columns={"b": "P b [psi]"}), unread=("P_c",))
RUNS = [logged("run 1"), table("run 2", **FAST)]
TWICE = LoggedTable(pd.concat([logged().channels, logged().channels[["a"]]], axis=1))


@pytest.mark.parametrize(
    ("tables", "change", "message"),
    [
        ([table("fast", **FAST), SLOW_TIME], {}, "no time channel 't' in its table 'slow', which holds besides 't2'"),
        ([table("fast", **FAST), NO_TIME], STAMPED, "'x' (for 'position_m') has 3 rows, but its time channel 't' has"),
        ([logged()], {"time_s": ChannelMapping("Time", "s")}, "channel 'Time' (for 'time_s') is missing; got"),
        ([table("fast", **DATED), table("slow", **SLOW)], {}, "time channel 't' holds dates, but 't' does not;"),
        (
            BEGUN,
            {},
            "its tables state different starts, 2026-03-14T08:15:00.000 and 2026-03-14T08:15:01.000, and their",
        ),
        ([RENAMED], {"pressure_2_pa": ChannelMapping("p_B [psi]", "psi")}, "'P_c' (nearest: 'P b [psi]'); corr"),
        ([TWICE], {}, "'a' (for 'pressure_1_pa') occurs 2 times"),
        (RUNS, {}, "channel 'a' (for 'pressure_1_pa') occurs in tables 'run 1', 'run 2'; state which as channels.p"),
        (RUNS, {"pressure_1_pa": ChannelMapping("a", "bar", table="run 3")}, "is missing; got tables 'run 1', 'run 2'"),
        ([logged(a=["1.0", "open"])], {}, "'a' (for 'pressure_1_pa') holds 'open' in row 2 (1 in all);"),
        ([logged(t=["12:30", "12:31"])], {}, "'t' (for 'time_s') holds '12:30' in row 1"),
        ([logged(a=pd.to_datetime(["2026-01-01", "2026-01-02"]))], {}, "'a' (for 'pressure_1_pa') holds dates"),
        ([logged(units={"a": "MPa"})], {}, "'pressure_1_pa'): the file states the unit 'MPa', but it is read in 'bar'"),
        ([logged(units={"a": "V"})], {}, "'pressure_1_pa'): the file states the unit 'V', but it is read in 'bar'"),
        ([logged(units={"t": "s"})], {}, "'t' (for 'time_s'): the file states the unit 's', but it is read in 'ms'"),
        ([logged(units={"a": "bara"})], {}, "'bara', which is absolute pressure, but it is read as gauge pressure;"),
        ([table("fast", **FAST), table("slow", **SLOW)], RATE, "rate_hz = 200 Hz: 'fast' has 6, 'slow' has 3 rows"),
        ([logged()], {"time_s": ChannelMapping("t")}, "holds int64 and states no unit; expected dates, or numbers wit"),
    ],
)
def test_the_unmappable_is_refused(tables: list[LoggedTable], change: dict[str, ChannelMapping], message: str) -> None:
    with pytest.raises(RecordingError, match=re.escape(message)):
        map_signals(tables, MAPPING | change)


def test_a_channel_in_two_tables_is_that_of_the_stated_table() -> None:
    mapping = {name: replace(source, table="run 2") for name, source in MAPPING.items() if name != "time_s"}
    tables = [logged("run 1"), table("run 2", **FAST, x=np.zeros(6))]
    signals = map_signals(tables, MAPPING | mapping).signals
    assert [len(signal.values) for signal in signals.values()] == [6, 6, 6]
