"""Malformed and unusual requests to the served model: what each should get, and what is wrong with what it got.

A response is wrong if its status is not the expected one, if it is an error of the server, takes longer than a minute,
refuses with more than 1 kB, or holds a number that is not the reference's.
"""

from __future__ import annotations

import gzip
import http.client
import io
import itertools
import json
import socket
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import uvicorn
from numpy.typing import NDArray
from pyarrow import parquet

from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.service.scoring.app import create_app
from cylinder_friction.service.scoring.decoding import ARROW, CSV, JSON, PARQUET
from cylinder_friction.service.scoring.settings import ServeSettings

Array = NDArray[np.float64]
LONG_S = 60.0
LARGEST_REFUSAL_BYTES = 1024
TOLERANCE_N = 0.01
MAX_ROWS = 30_000
MAX_BODY_BYTES = 4 << 20
SETTINGS = ServeSettings(max_rows=MAX_ROWS, max_body_bytes=MAX_BODY_BYTES, timeout_s=10.0)
"""Limits small enough to be tried."""


@dataclass(frozen=True)
class Reply:
    """A response: status, headers in lower case, body."""

    status: int
    headers: dict[str, str]
    body: bytes

    def json(self) -> Any:
        return json.loads(self.body)

    @property
    def message(self) -> str:
        return str(self.json()["message"])


@dataclass(frozen=True)
class Server:
    """A server on loopback."""

    port: int

    def ask(
        self,
        body: Any = None,
        content_type: str | None = JSON,
        path: str = "/invocations",
        method: str = "POST",
        headers: Mapping[str, str] | None = None,
    ) -> Reply:
        """Send one request; what is neither bytes nor an iterator of them goes as JSON."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=120.0)
        if body is not None and not isinstance(body, bytes) and not hasattr(body, "__next__"):
            body = json.dumps(body).encode()
        named = {"Content-Type": content_type} if content_type is not None else {}
        try:
            connection.request(method, path, body, {**named, **(headers or {})})
            return _read(connection.getresponse())
        finally:
            connection.close()

    def get(self, path: str, headers: Mapping[str, str] | None = None) -> Reply:
        return self.ask(None, None, path, "GET", headers)

    def send(self, text: bytes) -> Reply:
        """Send bytes as they are; no further ones follow."""
        with socket.create_connection(("127.0.0.1", self.port), 120.0) as connection:
            connection.sendall(text)
            response = http.client.HTTPResponse(connection)
            response.begin()
            return _read(response)


def _read(response: http.client.HTTPResponse) -> Reply:
    return Reply(response.status, {name.lower(): value for name, value in response.getheaders()}, response.read())


@contextmanager
def serving(settings: ServeSettings, current: Path) -> Iterator[Server]:
    """Serve the model that ``current`` names on a free port, in a thread."""
    with socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        configuration = uvicorn.Config(create_app(settings, current), log_level="critical", access_log=False)
        server = uvicorn.Server(configuration)
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]}, daemon=True)
        thread.start()
        while not server.started:
            time.sleep(0.01)
        try:
            yield Server(listening.getsockname()[1])
        finally:
            server.should_exit = True
            thread.join()


@dataclass(frozen=True)
class Case:
    """A request and what it should get: a status, and where that is 200, the rows that are scored, one by one."""

    name: str
    status: int
    body: Any = None
    content_type: str | None = JSON
    samples: list[Array] = field(default_factory=list)
    headers: dict[str, str] = field(default_factory=dict)
    raw: bytes = b""


def cases(rows: Array) -> list[Case]:
    """Return the table, made from at least 700 rows of a recording in which the piston moves."""
    few = rows[:5]
    return [
        *_json_text(few),
        *_json_forms(few),
        *_recordings(rows[:400]),
        *_csv(few),
        *_tables(few),
        *_arrow(few),
        *_parquet(few),
        *_headers(few),
        *_limits(rows),
        *_wire(few),
    ]


def split(rows: Array, names: tuple[str, ...] = SAMPLE_COLUMNS, **more: Any) -> dict[str, Any]:
    return {"dataframe_split": {"columns": list(names), "data": rows.tolist(), **more}}


def records(rows: Array, **more: Any) -> dict[str, Any]:
    return {"dataframe_records": [{**dict(zip(SAMPLE_COLUMNS, row, strict=True)), **more} for row in rows.tolist()]}


def _text(rows: Array) -> bytes:
    return json.dumps(split(rows)).encode()


def _json_text(rows: Array) -> list[Case]:
    whole, first = _text(rows), json.dumps(rows[0].tolist()).encode()
    texts: dict[str, bytes] = {
        "nothing": b"",
        "a brace": b"{",
        "cut off": whole[: len(whole) // 2],
        "NaN": whole.replace(first, b"[NaN, 9e5, 0.1]"),
        "1e999": whole.replace(first, b"[1e999, 9e5, 0.1]"),
        "a leading zero": whole.replace(first, b"[0123, 9e5, 0.1]"),
        "a decimal comma": whole.replace(first, b"[1,5e6, 9e5, 0.1"),
        "1,000 lists deep in a cell": whole.replace(first, b"[" + b"[" * 999 + b"]" * 999 + b", 9e5, 0.1]"),
        "Latin-1": whole.replace(b'"data"', '"dät"'.encode("latin-1")),
        "UTF-16": whole.decode().encode("utf-16"),
        "a byte order mark": b"\xef\xbb\xbf" + whole,
        "half a surrogate": whole.replace(b'"data"', b'"data\\ud800"'),
        "null": b"null",
        "a list of records": json.dumps(records(rows)["dataframe_records"]).encode(),
        "CSV": csv(rows),
        "gzip without its header": gzip.compress(whole),
        "a key twice": whole[:-1] + b", " + whole[1:],
        "an escaped key twice": whole[:-2] + b', "d\\u0061ta": [[1e6, 9e5, 0.1]]}}',
        "a column twice in a record": b'{"dataframe_records": [{"pressure_1_pa": 1e6, "pressure_1_pa": 2e6, '
        b'"pressure_2_pa": 9e5, "position_m": 0.1}]}',
        "a column twice among inputs": b'{"inputs": {"pressure_1_pa": [1e6], "pressure_2_pa": [9e5], '
        b'"position_m": [0.1], "position_m": [0.2]}}',
    }  # fmt: skip
    refused = [Case(f"JSON: {name}", 400, text) for name, text in texts.items()]
    spaced = json.dumps(split(rows), indent=4).encode()
    place = b"%.17g" % rows[0, 2]
    exact = whole.replace(first, b"[%s, 9e5, %s]" % (b"1000000.00000000000000000000000000000001", place))
    changed = rows.copy()
    changed[0, :2] = 1e6, 9e5
    good = [
        Case("JSON: indented", 200, spaced, samples=[rows]),
        Case("JSON: more digits than a float has", 200, exact, samples=[changed]),
        Case("JSON: whole numbers", 200, whole.replace(first, b"[1000000, 900000, %s]" % place), samples=[changed]),
        Case("JSON: exponents", 200, whole.replace(first, b"[1E+6, 9e+05, %.17e]" % rows[0, 2]), samples=[changed]),
        Case("JSON: a key escaped", 200, whole.replace(b'"data"', b'"d\\u0061ta"'), samples=[rows]),
    ]
    return refused + good


def _json_forms(rows: Array) -> list[Case]:
    lists, (row, *_) = rows.tolist(), rows.tolist()
    named = records(rows)["dataframe_records"]
    by_column = dict(zip(SAMPLE_COLUMNS, rows.T.tolist(), strict=True))
    names = list(SAMPLE_COLUMNS)
    good: dict[str, Any] = {
        "dataframe_split": split(rows),
        "dataframe_records": records(rows),
        "dataframe_records in another order of columns": {
            "dataframe_records": [dict(reversed(each.items())) for each in named]
        },
        "inputs": {"inputs": by_column},
        "instances": {"instances": named},
        "empty params": {**split(rows), "params": {}},
    }
    unclear: dict[str, Any] = {
        "two forms": {**split(rows), **records(rows)},
        "a misspelt form": {"dataframe_splits": split(rows)["dataframe_split"]},
        "the form of pandas": split(rows)["dataframe_split"],
        "a signature name": {"signature_name": "default", "instances": named},
    }
    wrong: dict[str, Any] = {
        "params": {**split(rows), "params": {"sample_time_s": 0.01}},
        "split without columns": {"dataframe_split": {"data": lists}},
        "split without data": {"dataframe_split": {"columns": names}},
        "split with another key": split(rows, dtype="float"),
        "columns are text": {"dataframe_split": {"columns": "pressure_1_pa", "data": lists}},
        "columns twice": {"dataframe_split": {"columns": [*names, "position_m"], "data": [[*row, 0.3]]}},
        "data are an object": {"dataframe_split": {"columns": names, "data": by_column}},
        "a row too short": {"dataframe_split": {"columns": names, "data": [*lists, row[:2]]}},
        "a row too long": {"dataframe_split": {"columns": names, "data": [*lists, [*row, 1.0]]}},
        "a row is text of three letters": {"dataframe_split": {"columns": names, "data": [*lists, "abc"]}},
        "an index of another length": split(rows, index=[0, 1]),
        "records are an object": {"dataframe_records": by_column},
        "records are lists": {"dataframe_records": lists},
        "a record lacks a column": {"dataframe_records": [*named, {"pressure_1_pa": 1e6, "pressure_2_pa": 9e5}]},
        "a record has one column for another": {
            "dataframe_records": [*named, {**{key: named[0][key] for key in names[:2]}, "position_mm": 100.0}]
        },
        "inputs without keys": {"inputs": {}},
        "inputs are records": {"inputs": named},
        "inputs of different lengths": {"inputs": {**by_column, "position_m": [0.1]}},
        "inputs are numbers": {"inputs": dict(zip(names, row, strict=True))},
        "instances are rows": {"instances": lists},
    }
    return [
        *(Case(f"form: {name}", 200, body, samples=[rows]) for name, body in good.items()),
        *(Case(f"form: {name}", 400, body) for name, body in unclear.items()),
        *(Case(f"form: {name}", 422, body) for name, body in wrong.items()),
    ]


def _recordings(rows: Array) -> list[Case]:
    half = len(rows) // 2

    def named(*names: Any) -> dict[str, Any]:
        data = [[name, *row] for name, row in zip(names, itertools.cycle(rows.tolist()), strict=False)]
        return {"dataframe_split": {"columns": ["recording", *SAMPLE_COLUMNS], "data": data}}

    both = [rows[:half], rows[half:]]
    good: dict[str, tuple[dict[str, Any], list[Array]]] = {
        "two": (named(*["a"] * half, *["b"] * half), both),
        "with a colon": (named(*["10:00"] * half, *["10:05"] * half), both),
        "with a zero byte": (named(*["a"] * half, *["a\0"] * half), both),
        "that differ in composition of a letter": (named(*["\u00e9"] * half, *["e\u0301"] * half), both),
        "whole numbers": (named(*[1] * half, *[2] * half), both),
    }
    return [
        *(Case(f"recording: {name}", 200, body, samples=samples) for name, (body, samples) in good.items()),
        Case("recording: a new one in every row", 413, named(*map(str, range(1001)))),
    ]


def csv(rows: Array, header: str = ",".join(SAMPLE_COLUMNS), end: str = "\n") -> bytes:
    lines = [header, *(",".join(map(repr, row)) for row in rows.tolist())]
    return "".join(line + end for line in lines).encode()


def _csv(rows: Array) -> list[Case]:
    text, header = csv(rows), ",".join(SAMPLE_COLUMNS).encode() + b"\n"
    numbered = b"".join(
        (str(at - 1).encode() if at else b"") + b"," + line for at, line in enumerate(text.splitlines(keepends=True))
    )
    good = {
        "plain": text,
        "with CRLF": csv(rows, end="\r\n"),
        "a byte order mark": b"\xef\xbb\xbf" + text,
        "numbered rows, as pandas writes them": numbered,
    }
    wrong = {
        "nothing": b"",
        "other columns": b"a,b\n1,2\n",
        "text": header + b"high,9e5,0.1\n",
        "an empty cell": header + b",9e5,0.1\n",
        "NaN": header + b"nan,9e5,0.1\n",
        "a row too short": text + b"1e6,9e5\n",
        "a row too long": text + b"1e6,9e5,0.1,0.2\n",
        "semicolons": text.replace(b",", b";"),
        "decimal commas": header + b'"1,5e6","9,1e5","0,1"\n',
        "a line of units": header + b"Pa,Pa,m\n" + text.split(b"\n", 1)[1],
        "a column twice": csv(rows, "pressure_1_pa,pressure_1_pa,position_m"),
        "an open quote": text + b'"1e6,9e5,0.1\n',
        "rows that are numbered from 7": b",".join([b"", header]) + b"7,1e6,9e5,0.1\n",
        "a cell of 100,000 letters": header + b"x" * 100_000 + b",9e5,0.1\n",
        "JSON": _text(rows),
    }
    unreadable = {"Latin-1": b"pr\xe9ssure\n1\n", "UTF-16": text.decode().encode("utf-16")}
    return [
        *(Case(f"CSV: {name}", 200, body, CSV, [rows]) for name, body in good.items()),
        *(Case(f"CSV: {name}", 422, body, CSV) for name, body in wrong.items()),
        *(Case(f"CSV: {name}", 400, body, CSV) for name, body in unreadable.items()),
    ]


def arrow_table(rows: Array) -> pa.Table:
    return pa.table(dict(zip(SAMPLE_COLUMNS, rows.T, strict=True)))


def arrow_stream(table: pa.Table, **options: Any) -> bytes:
    sink = io.BytesIO()
    with pa.ipc.new_stream(sink, table.schema, options=pa.ipc.IpcWriteOptions(**options)) as writer:
        writer.write_table(table)
    return sink.getvalue()


def parquet_file(table: pa.Table, compression: str = "snappy") -> bytes:
    sink = io.BytesIO()
    parquet.write_table(table, sink, compression=compression)
    return sink.getvalue()


def _tables(rows: Array) -> Iterator[Case]:
    """Return tables that can be scored and others that cannot, in both formats."""
    table = arrow_table(rows)
    names = pa.array(["a", "a", "b", "b", "b"])
    first, *others = SAMPLE_COLUMNS

    def with_first(values: pa.Array) -> pa.Table:
        return table.set_column(0, first, values)

    good = {
        "plain": (table, [rows]),
        "in another order of columns": (table.select([*others[::-1], first]), [rows]),
        "two recordings": (table.append_column("recording", names), [rows[:2], rows[2:]]),
        "recordings in a dictionary": (
            table.append_column("recording", names.dictionary_encode()),
            [rows[:2], rows[2:]],
        ),
        **{
            name: (with_first(pa.array(values)), [np.column_stack([values, rows[:, 1:]])])
            for name, values in (
                ("single precision", rows[:, 0].astype(np.float32)),
                ("whole numbers", rows[:, 0].astype(np.int64)),
            )
        },
        "in two pieces": (pa.concat_tables([table.slice(0, 2), table.slice(2)]), [rows]),
    }
    wrong = {
        "a column missing": table.select(others),
        "a column twice": pa.Table.from_arrays([*table.columns, table[first]], names=[*SAMPLE_COLUMNS, first]),
        "a value missing": with_first(pa.array([1e6, None, 1e6, 1e6, 1e6])),
        "NaN": with_first(pa.array([1e6, np.nan, 1e6, 1e6, 1e6])),
        "booleans": with_first(pa.array([True] * 5)),
        "numbers as text": with_first(pa.array(["1e6"] * 5)),
        "dates": with_first(pa.array([0] * 5, pa.timestamp("us"))),
        "a recording without a name": table.append_column("recording", pa.array(["a", None, "a", "a", "a"])),
    }
    for media, write in ((ARROW, arrow_stream), (PARQUET, parquet_file)):
        for name, (scored, samples) in good.items():
            yield Case(f"{media}: {name}", 200, write(scored), media, samples)
        for name, refused in wrong.items():
            yield Case(f"{media}: {name}", 422, write(refused), media)


def _arrow(rows: Array) -> list[Case]:
    stream = arrow_stream(arrow_table(rows))
    file = io.BytesIO()
    with pa.ipc.new_file(file, arrow_table(rows).schema) as writer:
        writer.write_table(arrow_table(rows))
    garbage = bytearray(stream)
    garbage[200:260] = b"\xff" * 60
    unreadable = {
        "nothing": b"",
        "cut off": stream[: len(stream) // 2],
        "a file in place of a stream": file.getvalue(),
        "bytes changed": bytes(garbage),
        "a length beyond the body": b"\xff\xff\xff\xff\xff\xff\xff\x7f" + stream[8:],
        "JSON": _text(rows),
    }
    packed = arrow_table(np.zeros((5, 3)))
    return [
        *(Case(f"Arrow: {name}", 400, body, ARROW) for name, body in unreadable.items()),
        Case("Arrow: compressed (zstd)", 422, arrow_stream(packed, compression="zstd"), ARROW),
        Case("Arrow: compressed (lz4)", 422, arrow_stream(packed, compression="lz4"), ARROW),
        Case("Arrow: in, JSON out", 200, arrow_stream(arrow_table(rows)), ARROW, [rows], headers={"Accept": JSON}),
        Case("Arrow: JSON in, Arrow out", 200, split(rows), samples=[rows], headers={"Accept": ARROW}),
    ]


def _parquet(rows: Array) -> list[Case]:
    plain = parquet_file(arrow_table(rows))
    garbage = bytearray(plain)
    garbage[4:60] = b"\xff" * 56
    unreadable = {
        "nothing": b"",
        "cut off": plain[:-30],
        "without its head": plain[30:],
        "magic bytes alone": b"PAR1PAR1",
        "a footer beyond the file": b"PAR1" + b"\x00" * 20 + b"\xff\xff\xff\x7fPAR1",
        "pages changed": bytes(garbage),
        "JSON": _text(rows),
    }
    return [
        *(Case(f"Parquet: {name}", 400, body, PARQUET) for name, body in unreadable.items()),
        Case("Parquet: gzip", 200, parquet_file(arrow_table(rows), "gzip"), PARQUET, [rows]),
    ]


def _headers(rows: Array) -> list[Case]:
    body, long = _text(rows), "x" * 10_000
    types: dict[str, tuple[int, str | None]] = {
        "missing": (415, None),
        "nothing": (415, ""),
        "text/plain": (415, "text/plain"),
        "pickle": (415, "application/python-pickle"),
        "Latin-1": (415, "application/json; charset=latin-1"),
        "of 10,000 letters behind a good one": (415, f"application/json; {long}"),
        "in capitals": (200, "Application/JSON"),
        "UTF-8": (200, "application/json; charset=UTF-8"),
        "ending in a semicolon": (200, "application/json;"),
    }
    packed = gzip.compress(b" " * 50_000_000)
    return [
        *(
            Case(f"Content-Type: {name}", status, body, media, [rows] if status == 200 else [])
            for name, (status, media) in types.items()
        ),
        Case("Content-Encoding: gzip of 50 MB", 415, packed, headers={"Content-Encoding": "gzip"}),
        Case("Content-Encoding: identity", 200, body, samples=[rows], headers={"Content-Encoding": "identity"}),
        Case("Accept: HTML", 200, body, samples=[rows], headers={"Accept": "text/html"}),
    ]


def _limits(rows: Array) -> list[Case]:
    many = np.tile(np.concatenate([rows, rows[::-1]]), (MAX_ROWS // (2 * len(rows)) + 2, 1))  # the piston never jumps
    dictionary = arrow_table(many[:20_000]).append_column(
        "recording", pa.array(["n" * 10_000] + ["b"] * 19_999).dictionary_encode()
    )
    zeros = pa.table({name: np.zeros(MAX_ROWS + 1) for name in SAMPLE_COLUMNS})
    known = [rows[:1], many[1:20_000]]
    blank = _text(rows[:1]) + b" " * MAX_BODY_BYTES
    return [
        Case("limits: a body beyond the limit", 413, blank),
        Case("limits: the same in pieces, without a length", 413, iter([blank[:1000], blank[1000:]])),
        Case("limits: a row too many", 413, split(many[: MAX_ROWS + 1].round(1))),
        Case("limits: a row too many as CSV", 413, csv(many[: MAX_ROWS + 1].round(3)), CSV),
        Case("limits: a row too many as Arrow", 413, arrow_stream(arrow_table(many[: MAX_ROWS + 1])), ARROW),
        Case("limits: a row too many as Parquet", 413, parquet_file(zeros), PARQUET),
        Case("limits: 4 MB of empty lists", 413, b'{"instances":[%s]}' % b",".join([b"[]"] * 1_300_000)),
        Case("limits: 100,000 lists deep", 413, b"[" * 100_000),
        Case("limits: 4 MB of digits", 400, b"1" * 4_000_000),
        Case("limits: a name of 4 MB", 422, {"dataframe_split": {"columns": ["x" * 4_000_000], "data": [[1.0]]}}),
        Case("limits: 20,000 rows, a name of 10,000 letters", 200, arrow_stream(dictionary), ARROW, known),
    ]  # fmt: skip


def _wire(rows: Array) -> list[Case]:
    body = _text(rows)
    head = b"POST /invocations HTTP/1.1\r\nHost: x\r\nContent-Type: application/json\r\n"
    much = head + b"Content-Length: 99999999999\r\n\r\n"
    chunked = head + b"Transfer-Encoding: chunked\r\n\r\n%x\r\n%s\r\n0\r\n\r\n" % (len(body), body)
    return [Case("wire: 100 GB announced", 413, raw=much), Case("wire: chunked", 200, samples=[rows], raw=chunked)]


Reference = Callable[[Array], tuple[Array, NDArray[np.int64]]]


def problem(case: Case, server: Server, reference: Reference) -> tuple[Reply | None, str]:
    """Send a request; return the response and what is wrong with it, if anything."""
    began = time.perf_counter()
    try:
        reply = server.send(case.raw) if case.raw else server.ask(
            case.body, case.content_type, headers=case.headers
        )  # fmt: skip
    except (OSError, http.client.HTTPException) as error:
        return None, f"no response: {error!r}"
    if (took_s := time.perf_counter() - began) > LONG_S:
        return reply, f"took {took_s:.0f} s"
    if reply.status != case.status:
        return reply, f"expected {case.status}"
    if reply.status != 200:
        large = len(reply.body) > LARGEST_REFUSAL_BYTES
        leaked = any(word in reply.body for word in (b"Traceback", b".py", str(Path.home()).encode() + b"/", b"/tmp/"))
        return reply, "too large" if large else "shows the server's insides" if leaked else ""
    return reply, _difference(_predictions(reply), case.samples, reference) if case.samples else ""


def _predictions(reply: Reply) -> list[dict[str, Any]]:
    if reply.headers["content-type"] == ARROW:
        return list(pa.ipc.open_stream(reply.body).read_all().to_pylist())
    return list(reply.json()["predictions"])


def _difference(predictions: list[dict[str, Any]], samples: list[Array], reference: Reference) -> str:
    newtons, flags = zip(*map(reference, samples), strict=True)
    expected, found = np.concatenate(newtons), np.array(
        [[row[name] for name in ("friction_n", "lower_n", "upper_n")] for row in predictions]
    )  # fmt: skip
    if found.shape != expected.shape:
        return f"{len(found)} rows, expected {len(expected)}"
    if (off_n := float(np.abs(found - expected).max())) > TOLERANCE_N:
        return f"{off_n:.3g} N from the reference"
    changed = [row["flags"] for row in predictions] != np.concatenate(flags).tolist()
    return "flags differ from the reference" if changed else ""
