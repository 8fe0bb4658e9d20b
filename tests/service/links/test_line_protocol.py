"""Lines for time-series databases: every row once, a database that is away or refuses holds nobody up."""

import json
import shutil
import subprocess
import threading
import time
import urllib.parse
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cylinder_friction.arrays import Array
from cylinder_friction.execution.ports import free_port
from cylinder_friction.service.client import Client
from cylinder_friction.service.links.line_protocol import LineProtocolLink
from cylinder_friction.service.live.service import LiveService
from cylinder_friction.service.live.settings import LineProtocolSettings
from live_process import served

START_S = 1.75e9


class Database(BaseHTTPRequestHandler):
    """Takes lines, with the replies that a test has set."""

    def do_POST(self) -> None:
        server: Any = self.server
        content = self.rfile.read(int(self.headers["Content-Length"])).decode()
        code = server.codes.pop(0) if server.codes else 204
        if code == 204:
            server.lines += content.splitlines()
            server.tokens.add(self.headers.get("Authorization"))
        self.send_response(code)
        self.send_header("Content-Length", "0")
        self.end_headers()

    def log_message(self, *_: object) -> None:
        """Nothing."""


@contextmanager
def database(*codes: int) -> Iterator[Any]:
    server: Any = ThreadingHTTPServer(("127.0.0.1", 0), Database)
    server.codes, server.lines, server.tokens = list(codes), [], set()
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    try:
        yield server
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


Sent = Callable[..., LineProtocolLink]


@pytest.fixture
def sent(service: LiveService, samples: Array, tmp_path: Path) -> Sent:
    """Return the link with its settings, after samples were stepped and the service has ended."""

    def sent(rows: int, settings: LineProtocolSettings, name: str = "a 7", wait_s: float = 0.0) -> LineProtocolLink:
        link, port = LineProtocolLink(settings), free_port()

        def use() -> None:
            with Client(f"ws://127.0.0.1:{port}/stream", name, 0.005, start_time_s=START_S) as client:
                for begin in range(0, rows, 70):
                    client.send(samples[begin : min(begin + 70, rows)])
                client.wait_until_kept()
            time.sleep(wait_s)

        served([link], service, tmp_path, use, port)
        return link

    return sent


def url_of(server: Any) -> str:
    return f"http://127.0.0.1:{server.server_port}/write?db=friction"


def test_every_row_arrives_once_with_its_time(sent: Sent, newtons: Array, flags: Array, tmp_path: Path) -> None:
    """A database that is away for a while gets them later, with the token of the file."""
    (tmp_path / "token").write_text("a-word\n", encoding="utf-8")
    with database(503, 401) as server:
        token = str(tmp_path / "token")
        settings = LineProtocolSettings(url_of(server), token_file=token, rows_hz=0.0, flush_s=0.05, batch_rows=100)
        link = sent(500, settings, wait_s=0.5)
        assert server.tokens == {"Token a-word"}
        first = server.lines[0]
        fields = [line.split(" ")[-2] for line in server.lines]
    values = [dict(part.split("=") for part in each.split(",")) for each in fields]
    got = np.array([[float(each[name]) for name in ("friction_n", "lower_n", "upper_n")] for each in values])
    np.testing.assert_array_equal(got, newtons[:500])
    assert [each["flags"] for each in values] == [f"{flag}i" for flag in flags[:500].tolist()]
    assert [each["index"] for each in values] == [f"{index}i" for index in range(500)]
    assert first.startswith("friction,session=a\\ 7 friction_n=")
    assert first.endswith(" 1750000000000000000")
    assert +link.counts == {"rows": 500, "retries": 2}


def test_rows_by_index_in_a_file_per_day(sent: Sent, tmp_path: Path) -> None:
    settings = LineProtocolSettings(folder=str(tmp_path / "lines"), rows_hz=10.0, flush_s=0.05)
    sent(400, settings)
    (file,) = (tmp_path / "lines").iterdir()
    assert file.name == "2025-06-15.lp"
    lines = file.read_text(encoding="utf-8").splitlines()
    expected = [f"{index}i {10**9 * round(START_S) + 5_000_000 * index}" for index in range(0, 400, 20)]
    assert [line.split("index=")[1] for line in lines] == expected


def test_lines_that_are_refused_are_counted_and_not_sent_again(sent: Sent) -> None:
    with database(400) as server:
        settings = LineProtocolSettings(url_of(server), rows_hz=0.0, flush_s=0.05, batch_rows=100_000)
        link = sent(70, settings)
        assert server.lines == []
    assert +link.counts == {"refused": 70}


def test_without_a_database_the_oldest_rows_are_dropped_and_counted(sent: Sent) -> None:
    settings = LineProtocolSettings(f"http://127.0.0.1:{free_port()}/write", rows_hz=0.0, flush_s=0.05, queue_rows=150)
    link = sent(700, settings)
    assert link.counts["dropped"] == 700
    assert link.counts["retries"] > 0
    assert link.counts["rows"] == 0


@pytest.mark.extended
@pytest.mark.skipif(shutil.which("influxd") is None, reason="influxdb is not installed")
def test_influxdb_takes_the_lines(sent: Sent, newtons: Array, tmp_path: Path) -> None:
    port, inner = free_port(), free_port()
    config = tmp_path / "influx.conf"
    config.write_text(
        f'bind-address = "127.0.0.1:{inner}"\nreporting-disabled = true\n[meta]\ndir = "{tmp_path}/meta"\n'
        f'[data]\ndir = "{tmp_path}/data"\nwal-dir = "{tmp_path}/wal"\n[http]\nbind-address = "127.0.0.1:{port}"\n',
        encoding="utf-8",
    )
    process = subprocess.Popen(["influxd", "-config", config], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def query(text: str, body: bytes | None = None) -> Any:
        data = urllib.parse.urlencode({"q": text, "db": "friction", "epoch": "ns"})
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/query?{data}", body) as reply:
            return json.load(reply)

    try:
        for _ in range(200):
            try:
                urllib.request.urlopen(f"http://127.0.0.1:{port}/ping", timeout=10.0).close()
                break
            except OSError:
                time.sleep(0.1)
        query("CREATE DATABASE friction", b"")
        settings = LineProtocolSettings(f"http://127.0.0.1:{port}/write?db=friction", rows_hz=0.0, flush_s=0.05)
        link = sent(300, settings, "hall 3/press 7")
        selected = "SELECT friction_n, lower_n, upper_n, index FROM friction WHERE session = 'hall 3/press 7'"
        (series,) = query(selected)["results"][0]["series"]
    finally:
        process.kill()
        process.wait()
    got = np.array([row[1:4] for row in series["values"]])
    np.testing.assert_array_equal(got, newtons[:300])
    assert [row[4] for row in series["values"]] == list(range(300))
    assert [row[0] for row in series["values"]] == [10**9 * round(START_S) + 5_000_000 * index for index in range(300)]
    assert +link.counts == {"rows": 300}


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({}, r"got url None, folder None; expected one of them"),
        ({"url": "file:///etc/passwd"}, r"url\n.*should match pattern"),
        ({"folder": "lines", "rows_hz": -1.0}, r"rows_hz\n.*greater than or equal to 0"),
        ({"folder": "lines", "flush_s": 0.0}, r"flush_s\n.*greater than 0"),
    ],
)
def test_settings_that_cannot_be_are_refused(settings: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        LineProtocolSettings(**settings)
