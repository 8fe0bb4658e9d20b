from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.recordings.formats.format import CsvOptions, LoggedTable
from cylinder_friction.recordings.formats.reading import read_logged_file
from cylinder_friction.recordings.mapping.channel_mapping import ChannelMapping
from cylinder_friction.recordings.mapping.guessing import guess_mapping
from cylinder_friction.recordings.mapping.mapped_file import map_signals
from cylinder_friction.recordings.recording import RecordingError


@pytest.fixture
def read(tmp_path: Path):  # type: ignore[no-untyped-def]
    """Write text to a file as it is, and read it."""

    def written(content: str | bytes, *, wanted: list[str] | None = None, **options: str) -> LoggedTable:
        path = tmp_path / "log.csv"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        (table,) = read_logged_file(path, CsvOptions(**options), wanted)
        return table

    return written


TWO = {"t": [0.0, 0.5], "p": [1.5, 2.5]}
ROWS = "0,1.5\n0.5,2.5\n"
DATE_FORMS = ["dd.mm.yyyy hh:mm:ss", "dd.mm.yyyy hh:mm:ss.000", "TT.MM.JJJJ hh:mm:ss", "HH:mm:ss"]
MISSING = ["", "nan", "NaN", "NA", "N/A", "null", "-", "#N/A", " ", "1.#QNAN"]
QUOTED = 't,p\n"0","1,234"\n"1","2,345"\n'
LABVIEW = (
    "LabVIEW Measurement,\nSeparator,Comma\nDecimal_Separator,.\n***End_of_Header***,\n,\nChannels,1,\nSamples,2,\n"
    "Time,08:15:00,\nY_Unit_Label,bar,\nX0,0.0,\n***End_of_Header***,,\nt,p,Comment\n"
)


@pytest.mark.parametrize(
    "content",
    [
        "t,p\n" + ROWS,
        "t\tp\r0\t1.5\r0.5\t2.5\r",
        "Logger 7\n\n  t    p\n  0.0   1.5\n  0.5   2.5  \n",
        "t, p\n0, +1.5\n.5, 2.5E0\n",
        "t,p\n0,1.5,\n0.5,2.5,\n",
        "\n\nt,p\n\n0,1.5\n\n0.5,2.5\n\n\n",
        "\ufefft,p\n" + ROWS,
        ("t,p\n" + ROWS).encode("utf-16"),
        b"\xff\xfe" + "t;p\r\n0;1,5\r\n0,5;2,5\r\n".encode("utf-16-le"),
        "# logger 7\n# serial 123, bench 2\nt,p\n" + ROWS,
        "# t, p\n" + ROWS,
        "Logger: X200\nStart: 2026-03-14 08:15:00\nRate [Hz]: 2\n\nt,p\n" + ROWS,
        LABVIEW + ROWS,
        "Gain,1\nUnit,bar\nt,p\n" + ROWS,
        "HBM_CATMAN 5.0\nT0=08:15\nt,p\ns,bar\n" + ROWS,
    ],
)
def test_every_spelling_of_one_table(read, content: str | bytes) -> None:  # type: ignore[no-untyped-def]
    table = read(content)
    assert table.channels.to_dict("list") == TWO
    assert table.notes == ()


@pytest.mark.parametrize(
    ("header", "units"),
    [
        ("t [s],P1 [bar] (AVE),axis[1]", {"t [s]": "s", "P1 [bar] (AVE)": "bar"}),
        ("t (s),P1 (bar),pressure (A)", {"t (s)": "s", "P1 (bar)": "bar"}),
        ("t/s,v/mm/s,p in N/mm²", {"t/s": "s", "v/mm/s": "mm/s", "p in N/mm²": "N/mm²"}),
        ("t/s,Druck Boden/bar,Pump speed rev/min", {"t/s": "s", "Druck Boden/bar": "bar"}),
        ("t,P1 (rod side),x\ns,bar,mm", {"t": "s", "P1 (rod side)": "bar", "x": "mm"}),
        ("t,P1,x\n[s],[bar],", {"t": "s", "P1": "bar"}),
        ("TIMESTAMP,P1,x\nTS,bar,Deg C\n,Smp,Avg", {"P1": "bar", "x": "Deg C"}),  # of Campbell Scientific
        ("t,P1,x\n(s),(bar),(°C)\nclock,piston,oil", {"t": "s", "P1": "bar", "x": "°C"}),
        ("t,P1,x\n,Type: double,Type: single\n,Unit: bar,Unit: mm", {"P1": "bar", "x": "mm"}),  # of Simulink
        ("t,P1,x\n2ms,0.1bar,mm (x2)", {"t": "2ms", "P1": "0.1bar", "x": "mm (x2)"}),
        ("t,P1,x\nf8,DateTime64(3),LREAL\n(s),(bar),(mm)", {"t": "s", "P1": "bar", "x": "mm"}),
        *[(f"t,P1,x\n{form},bar,mm", {"P1": "bar", "x": "mm"}) for form in DATE_FORMS],
    ],
)
def test_units_of_the_header(read, header: str, units: dict[str, str]) -> None:  # type: ignore[no-untyped-def]
    """A line of units may state how dates are written."""
    table = read(header + "\n" + "".join(f"26.03.2026 08:15:0{row},1,2\n" for row in range(6)))
    assert table.units == units
    assert list(table.channels.columns) == header.split("\n", maxsplit=1)[0].split(",")


@pytest.mark.parametrize(
    ("content", "options", "column", "values"),
    [
        ("0\t1.5\n1\t2.5\n", {}, "column_2", [1.5, 2.5]),
        ("p [bar]\n3,845\n3,9\n", {"delimiter": ";", "decimal": ","}, "p [bar]", [3.845, 3.9]),
        (QUOTED, {}, "p", ["1,234", "2,345"]),
        (QUOTED, {"decimal": ","}, "p", [1.234, 2.345]),
        ("t^p\n0^1,5\n1^2,5\n", {"delimiter": "^"}, "p", [1.5, 2.5]),
        ("T [°C]\r\n40.5\r\n".encode("cp437"), {"encoding": "cp437"}, "T [°C]", [40.5]),
        ("t,p\n" + "".join(f"1,{cell}\n" for cell in MISSING) + "99,1.5\n", {}, "p", [np.nan] * 10 + [1.5]),
        (f'"{"note " * 40_000}"\nt,p\n0,1.5\n1,2.5\n', {}, "p", [1.5, 2.5]),  # the module csv takes 131,072 characters
        ("t,p\n" + "0,\n1,\n", {}, "p", [np.nan] * 2),
        ("Trace,p\nSize,2\nVUnit,bar\nDelay,0\n\n" + ",1.5\n" * 9, {}, "p", [1.5] * 9),
        ("LabVIEW Measurement\t\nt\tp A\tComment\n" + "0\t1.5\n" * 9, {}, "p A", [1.5] * 9),
        ("t;p\n0;1.5\n1;broken\n3;-2e1\n", {}, "p", [1.5, "broken", -20.0]),
        ("t;p\n0;1.5\n" + "1;2\n" * 60 + '2;"3"\n3;broken\n', {}, "p", [1.5, *[2.0] * 60, 3.0, "broken"]),
        ("t;p\n0;1,5\n1;1.234,5\n2;3.845\n3;2,5\n", {}, "p", [1.5, 1234.5, "3.845", 2.5]),  # points and commas
        ("t;p\n0;-1,234,567.5\n1;950.5\n2;1.5D+02\n", {}, "p", [-1234567.5, 950.5, 150.0]),
        ("t;p\n0;high\n1;high\n" + "2;1.5\n" * 18, {}, "p", ["high", "high", *[1.5] * 18]),
        ("t;p\n" + "1;+  7.205\n" * 5, {}, "p", [7.205] * 5),
        ("t;p\n" + "0;1.5\n1;2\n" * 40, {}, "t", [0, 1] * 40),
        ("t;p\n" + "0.5;9007199254740993\n1;2\n" * 40, {}, "p", [9007199254740993, 2] * 40),
        ("t;p\n" + "0;0\n" * 20000 + "20000;0,5\n", {}, "p", [0.0] * 20000 + [0.5]),  # a decimal comma that shows late
    ],
)
def test_cells_become_values(  # type: ignore[no-untyped-def]
    read, content: str | bytes, options: dict[str, str], column: str, values: list[Any]
) -> None:
    found = read(content, **options).channels[column]
    assert found.dtype == pd.Series(values).dtype
    np.testing.assert_array_equal(found, pd.Series(values))


def test_older_encodings_are_recognised(read) -> None:  # type: ignore[no-untyped-def]
    assert read("T [°C],F [µN]\n40.5,1\n".encode("cp1252")).units == {"T [°C]": "°C", "F [µN]": "µN"}
    # The first character beyond ASCII comes far down, in a remark.
    assert [*read("时间,压力\n1,2\n".encode("gbk")).channels] == ["时间", "压力"]
    rows = "".join(f"{i},ok\n" for i in range(20000))
    table = read(f"t,remark\n{rows}20000,zu heiß\n".encode("cp1252"))
    assert table.channels["remark"].iloc[-1] == "zu heiß"
    with pytest.raises(RecordingError, match=r"its characters are not UTF-8: .*; name the right encoding"):
        read(f"t,remark\n{rows}20000,zu heiß\n".encode("cp1252"), encoding="utf-8")


@pytest.mark.parametrize("sign", ["overload", "∞", "+++++", "OL"])
def test_a_value_beyond_the_range_is_missing_and_stated(read, sign: str) -> None:  # type: ignore[no-untyped-def]
    table = read(f"t;p\n0;{sign}\n1;{sign}\n" + "2;1.5\n" * 18)
    np.testing.assert_array_equal(table.channels["p"], [np.nan, np.nan, *[1.5] * 18])
    assert table.notes == (f"2 cells of 'p' with {sign!r}, beyond the range of the input, taken as missing",)


@pytest.mark.parametrize(
    ("content", "kept", "note"),
    [
        ("t,p\n0,1\n1,2\n2,3", [1, 2], "its last line has no line end and may be cut in a number; it was left out:"),
        ("t,p\n0,1\n1,2\n" + "\0" * 500, [1, 2], "500 zero bytes at its end were left out"),
        ("t,p\r0,1\r1,2\r2,3", [1, 2], "left out: '2,3'"),
        ("t,p\n0,1\n1,2\n2,3\nEOF", [1, 2, 3], ""),
        ("t;p\r\n0;1\r\n1;2\r\nEOF;EOF\r\n", [1, 2], ""),
    ],
)
def test_an_open_end_is_cut_off_and_said(read, content: str, kept: list[int], note: str) -> None:  # type: ignore[no-untyped-def]
    table = read(content)
    assert table.channels["p"].tolist() == kept
    assert any(note in entry for entry in table.notes) if note else table.notes == ()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            "".join(f"{name}{';1.5' * 2000}\n" for name in ("t", "p")),
            "one line per channel, as 'p' with 2000 values; .*T.t",
        ),
        ("t,p\ns,bar\nScale,1,0.1\n" + ROWS, "holds factors above its rows, 'Scale,1,0.1', and nothing shows whether"),
        ("X0,0,0.5\nt,p\n" + ROWS, "states different starts of its channels, 'X0,0,0.5'; expected one; write a time"),
        ("t,p\n", r"no rows of numbers were found \(lines searched: 1\)"),
        (LABVIEW + ROWS * 99 + ",\n" + LABVIEW[LABVIEW.index("Chan") :], "two logs or segments"),
        ("a,b\n1,2\n3,4\n5\n", "line 4 holds 1 instead of 2 values: '5'; correct it, or cut"),
        ("# log 1\nt,p\n0,1\n1,2\n# log 2\nt,p\n0,3\n", "line 5 holds 1 instead of 2 values: '# log 2'"),
    ],
)
def test_what_is_no_table_is_refused(read, content: str, message: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(RecordingError, match=message):
        read(content)


def test_a_wide_file_is_recognised_beyond_its_first_bytes(read) -> None:  # type: ignore[no-untyped-def]
    names = [f"channel number {i} of the bench [bar]" for i in range(3000)]
    rows = "\n".join(",".join(str(i + j) for i in range(3000)) for j in range(3))
    table = read(",".join(names) + "\n" + rows + "\n", wanted=[names[2999]])
    assert table.channels.iloc[:, 0].tolist() == [2999, 3000, 3001]
    assert len(table.unread) == 2999


@pytest.mark.parametrize("key", ["Delta_X", "HResolution"])
def test_a_sample_time_in_the_header_is_the_rate_of_the_rows(read, key: str) -> None:  # type: ignore[no-untyped-def]
    rows = "Y_Unit_Label\tbar\tbar\tmm\nX_Value\tP1\tP2\tPosition\tComment\n" + "\t10.5\t20.5\t3.5\n" * 30
    table = read(f"{key}\t0,005\t0.005\t0.005\n{rows}")
    guessed = guess_mapping([table], Path("log.lvm")).columns
    assert guessed["time_s"].entry == {"rate_hz": 200.0}
    mapping = {name: ChannelMapping.from_dict(each.entry) for name, each in guessed.items()}
    assert map_signals([table], mapping).signals["position_m"].time_s[-1] == pytest.approx(0.145)
    with pytest.raises(RecordingError, match=r"header states 200 Hz, but time_s.rate_hz = 100 Hz; expected the same"):
        map_signals([table], mapping | {"time_s": ChannelMapping(rate_hz=100.0)})
    assert read(f"{key}\t0.005\t0.005\t0.010\n{rows}").rate_hz is None


def test_headers_of_r_and_of_tektronix(read) -> None:  # type: ignore[no-untyped-def]
    table = read('"t" "p"\n' + "".join(f'"{row}" {row / 2} 1.5\n' for row in range(1, 9)))
    assert [*table.channels] == ["column_1", "t", "p"]
    header = "Horizontal Units,s,,\nVertical Units,bar,bar,mm\nTIME,P1,P2,x\n"
    assert read(header + "0,1.5,2,3\n" * 9).units == {"P1": "bar", "P2": "bar", "x": "mm"}


def test_names_above_units_of_which_some_are_none(read) -> None:  # type: ignore[no-untyped-def]
    """As Graphtec writes them; two channels share a unit, and the line of units repeats no name."""
    rows = "".join(f"{row},2026/03/14 08:15:00,{5 * row},+  7.205,+8.9,+74.9,L\n" for row in range(1, 30))
    above = "Vendor,GRAPHTEC\nSampling interval,5ms\nStart time,2026/3/14,08:15:00\nData\n"
    names = "Number,Date&Time,ms,CH1,CH2,CH3,Alarm1\nNO.,Time,ms,bar,bar,mm,A1\n"
    for header in ("auto", "names_units"):
        table = read(above + names + rows, header=header)
        assert {name: table.units[name] for name in ("CH1", "CH2", "CH3")} == {"CH1": "bar", "CH2": "bar", "CH3": "mm"}
        assert table.channels["CH1"].tolist() == [7.205] * 29
