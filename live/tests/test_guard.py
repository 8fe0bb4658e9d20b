"""Who may do what: roles, names, and tokens as a browser and as others carry them; over TLS as well."""

import base64
import json
import select
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from contextlib import ExitStack, suppress
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from cylinder_friction.arrays import Array
from cylinder_friction_live import guard
from cylinder_friction_live.access import ROLES, Access
from cylinder_friction_live.client import Client, LiveClientError
from live_process import stalled_client

Served = Callable[..., str]

OPEN = {"session": "press", "inputs": ["pressure_1_pa", "pressure_2_pa", "position_m"], "sample_time_s": 0.005}
ROUTES = {"read": "/watch", "write": "/stream"}
UNKNOWN = ({}, {"Authorization": "Bearer a guess"}, {"Authorization": "Basic the write token"})


@pytest.fixture
def tokens(tmp_path: Path) -> Path:
    path = tmp_path / "tokens"
    lines = [f"{sha256(f'the {role} token'.encode()).hexdigest()} {role} of a test" for role in ROLES]
    path.write_text("\n".join(lines), encoding="ascii")
    return path


@pytest.fixture
def address(served: Served, tokens: Path) -> str:
    """Host and port of a service with tokens."""
    return served(Access(tokens=tokens, hosts=("Press-PC",)))


def bearer(token: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {token}"}


def got(address: str, path: str, headers: dict[str, str] | None = None) -> tuple[int, str, str]:
    """Status, body and the challenge of a request's reply."""
    try:
        with urllib.request.urlopen(urllib.request.Request(f"http://{address}{path}", headers=headers or {})) as reply:
            return reply.status, reply.read().decode(), ""
    except urllib.error.HTTPError as error:
        return error.code, error.read().decode(), error.headers.get("WWW-Authenticate", "")


def refused(address: str, path: str, headers: dict[str, str]) -> tuple[str, int]:
    """The reason and the code with which a WebSocket is closed."""
    with connect(f"ws://{address}{path}", additional_headers=headers) as socket:
        reason = json.loads(socket.recv())["error"]
        with pytest.raises(ConnectionClosed) as closed:
            socket.recv()
    assert closed.value.rcvd is not None
    return reason, closed.value.rcvd.code


def test_a_role_may_do_what_it_is_for_and_no_more(address: str) -> None:
    for has in ROLES:
        headers = bearer(f"the {has} token")
        for needs, path in ROUTES.items():
            if ROLES.index(has) < ROLES.index(needs):
                expected = "the role of this token is read; expected write", 4403
                assert refused(address, path, headers) == expected
                continue
            with connect(f"ws://{address}{path}", additional_headers=headers) as socket:
                socket.send("{")
                assert ("stribeck" if needs == "read" else "expected {") in socket.recv(timeout=60.0)
        assert got(address, "/metrics", headers)[0] == 200


def test_without_a_known_token_only_the_empty_page_and_health_are_shown(address: str) -> None:
    for headers in UNKNOWN:
        assert got(address, "/metrics", headers)[::2] == (401, "Bearer")
        for path in ROUTES.values():
            assert refused(address, path, headers) == ("expected a known token as Authorization: Bearer TOKEN", 4401)
    assert [got(address, path)[0] for path in ("/", "/static/live.js", "/livez")] == [200] * 3
    assert "loop_lag_s" in got(address, "/readyz")[1]
    metrics = got(address, "/metrics", bearer("the read token"))[1]
    assert 'cylinder_friction_live_refused_total{kind="token"} 9.0' in metrics


@pytest.mark.parametrize(("token", "passes"), [("the read token", True), ("a guess", False), (None, False)])
def test_a_browser_offers_its_token_as_a_subprotocol(address: str, token: str | None, passes: bool) -> None:
    encoded = "x" if token is None else base64.urlsafe_b64encode(token.encode()).decode().rstrip("=")
    offered = [guard.PROTOCOL, guard.TOKEN_PROTOCOL + encoded]
    with connect(f"ws://{address}/watch", subprotocols=offered) as socket:  # type: ignore[arg-type]
        assert socket.subprotocol == guard.PROTOCOL
        assert ("stribeck" in json.loads(socket.recv())) is passes


def test_other_names_and_origins_are_refused_also_with_a_token(address: str) -> None:
    known = bearer("the write token")
    status, body, _ = got(address, "/metrics", known | {"Host": "rebound.example"})
    assert status == 403
    assert "host 'rebound.example': not a name of this service" in body
    reason, code = refused(address, "/watch", known | {"Origin": "http://elsewhere.example"})
    assert "only this service's own page" in reason
    assert code == 4403
    for half in ("[::1", "["):
        status, body, _ = got(address, "/metrics", known | {"Host": half})
        assert (status, f"host {half!r}: not a name of this service" in body) == (403, True)
    for host in ("press-pc", "PRESS-PC:5002", "127.0.0.1:5002", "[::1]:5002", "localhost"):
        assert got(address, "/metrics", known | {"Host": host})[0] == 200


def test_a_client_brings_its_token_over_tls_and_gives_up_at_once_where_it_may_not(
    served: Served, tokens: Path, samples: Array, newtons: Array, certificate: tuple[Path, Path]
) -> None:
    trusted, key = certificate
    address = served(Access(tokens=tokens, tls_certificate=trusted, tls_key=key))
    url = f"wss://{address}/stream"
    with Client(url, "press", 0.005, token="the write token", ca=trusted) as client:
        client.send(samples[:50])
        np.testing.assert_array_equal(client.estimates()[1], newtons[:50])
    for token, ca, words in (
        ("the read token", trusted, "expected write"),
        ("", trusted, "expected a known token"),
        ("the write token", None, "certificate is not trusted"),
    ):
        with pytest.raises(LiveClientError, match=words):
            Client(url, "press", 0.005, token=token, ca=ca)


def closed(socket: ClientConnection) -> tuple[int | None, str | None]:
    """Code and reason with which a WebSocket is closed, when all before that is read."""
    with suppress(ConnectionClosed):
        for _ in range(100):
            socket.recv(timeout=60.0)
    return socket.close_code, socket.close_reason


def test_what_a_token_let_in_ends_with_it(served: Served, tokens: Path, samples: Array, tmp_path: Path) -> None:
    _, write = tokens.read_text(encoding="ascii").splitlines()
    stays_in = f"{sha256(b'a token that stays').hexdigest()} write"
    tokens.write_text(f"{tokens.read_text(encoding='ascii')}\n{stays_in}", encoding="ascii")
    address = served(Access(tokens=tokens), log=tmp_path / "log")
    with ExitStack() as stack:
        page, writer, left, stays = (
            stack.enter_context(connect(f"ws://{address}{path}", additional_headers=bearer(token)))
            for path, token in (
                ("/watch", "the read token"),
                ("/stream", "the write token"),
                ("/watch", "the write token"),
                ("/stream", "a token that stays"),
            )
        )
        tokens.write_text("nothing that holds tokens", encoding="ascii")  # refused as a whole: all stay
        stays.send(json.dumps({"open": OPEN}))
        assert "opened" in stays.recv(timeout=60.0)
        time.sleep(1.5)
        tokens.write_text(f"{write.replace(' write', ' read')}\n{stays_in}", encoding="ascii")
        assert closed(page) == (4401, "this token was taken out of the service's file")
        assert closed(writer) == (4403, "the role of this token is read; expected write")
        stays.send(json.dumps({"samples": {"session": "press", "index": 0, "rows": samples[:2].tolist()}}))
        assert "friction_n" in stays.recv(timeout=60.0)
        for _ in range(20):  # more than waited to be read
            left.recv(timeout=60.0)
        assert 'refused_total{kind="revoked"} 2.0' in got(address, "/metrics", bearer("a token that stays"))[1]
    events = [json.loads(line) for line in (tmp_path / "log").read_text(encoding="utf-8").splitlines()]
    why = [each["why"] for each in events if each["event"] == "connection closed" and each["client"]]
    lower = "the role of this token is read; expected write"
    assert sorted(why) == [lower, "this token was taken out of the service's file"]


def test_a_client_that_is_to_leave_and_reads_nothing_is_left(served: Served, tokens: Path, samples: Array) -> None:
    address = served(Access(tokens=tokens))
    with stalled_client(f"ws://{address}/stream", samples, bearer("the write token")) as stalled:
        gone = select.poll()
        gone.register(stalled, 0)  # reset, although nothing was read
        assert gone.poll(0.0) == []
        tokens.write_text(f"{sha256(b'another').hexdigest()} write", encoding="ascii")
        assert gone.poll(60_000) != []
