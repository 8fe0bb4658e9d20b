"""A client that misses estimates asks for them again, waits while acknowledgements come, and knows its addresses."""

from __future__ import annotations

import json
import time
from contextlib import contextmanager, nullcontext
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from cylinder_friction.live import client as client_module
from cylinder_friction.live.client import Client
from cylinder_friction.live.client_sockets import LiveClientError, connected
from cylinder_friction.live.frames import Acknowledgement, EstimateBlock, pack_acknowledgement, pack_estimates, unpack
from cylinder_friction.live.journal import Journal
from cylinder_friction.live.service import LiveService
from cylinder_friction.live.settings import TcpSettings
from cylinder_friction.live.tcp import TcpLink
from live_process import served

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from cylinder_friction.arrays import Array
    from cylinder_friction.estimators.hybrid import HybridEstimator
    from cylinder_friction.live.engine import Engine


class Leaky:
    """A socket that keeps the first estimates from index 100 on to itself, as a broker may."""

    window = None
    lost: int = 0

    def __init__(self, inner: Any) -> None:
        self.send, self._inner = inner.send, inner

    def recv(self, timeout_s: float) -> bytes | str:
        message = self._inner.recv(timeout_s)
        if isinstance(message, bytes) and not Leaky.lost:
            Leaky.lost = sum(len(e.flags) for e in unpack(message) if isinstance(e, EstimateBlock) and e.index >= 100)
            if Leaky.lost:
                return self.recv(timeout_s)
        return bytes(message) if isinstance(message, bytes) else str(message)


def test_estimates_that_were_lost_on_their_way_are_asked_for_again(
    engine: Engine, small_hybrid: HybridEstimator, samples: Array, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    @contextmanager
    def leaky(*given: Any) -> Iterator[Leaky]:
        with connected(*given) as inner:
            yield Leaky(inner)

    monkeypatch.setattr(client_module, "connected", leaky)
    tcp = TcpLink(TcpSettings(port=0))

    def use() -> Array:
        parts = []
        with Client(tcp.address, "press", 0.005) as client:
            for begin in range(0, 500, 50):
                client.send(samples[begin : begin + 50])
                parts.append(client.estimates(5.0))
            while len((part := client.estimates(0.5))[2]):
                parts.append(part)
        assert [index for index, _, _ in parts] == np.cumsum([0, *(len(each) for _, each, _ in parts[:-1])]).tolist()
        return np.concatenate([newtons for _, newtons, _ in parts])

    got = served([tcp], LiveService(engine, Journal(tmp_path / "journal.db")), tmp_path, use)
    assert Leaky.lost > 0
    np.testing.assert_array_equal(got, small_hybrid.real_time().run(samples[:500])[0])


def test_after_samples_that_were_left_out_a_client_stays_connected(
    engine: Engine, samples: Array, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing is missing where nothing was sent; connecting again would send all that is not acknowledged again."""
    connections: list[str] = []

    @contextmanager
    def counted(url: str, *given: Any) -> Iterator[Any]:
        connections.append(url)
        with connected(url, *given) as inner:
            yield inner

    monkeypatch.setattr(client_module, "connected", counted)
    tcp = TcpLink(TcpSettings(port=0))

    def use() -> list[int]:
        begun = []
        with Client(tcp.address, "press", 0.005) as client:
            for _ in range(3):
                client.send(samples[:50])
                client.skip(12_000)
                begun.append(client.estimates(5.0)[0])
            client.wait_until_kept()
        return begun

    assert served([tcp], LiveService(engine, Journal(tmp_path / "journal.db")), tmp_path, use) == [0, 12_050, 24_100]
    assert len(connections) == 1


class Slow:
    """A service that acknowledges ten rows with each message, one every twenty seconds, up to ``last``."""

    window = None

    def __init__(self, clock: list[float], last: int) -> None:
        self._clock, self._last, self._kept = clock, last, 0

    def send(self, message: bytes | str) -> None:
        """Take anything."""

    def recv(self, timeout_s: float) -> bytes | str:
        if self._clock[0] == 0.0:
            self._clock[0] = 20.0
            return json.dumps({"opened": {"handle": 1, "next_index": 0, "kept_index": 0}})
        self._clock[0] += 20.0
        if self._kept >= self._last:
            raise TimeoutError
        self._kept += 10
        return pack_acknowledgement(Acknowledgement(1, self._kept))


@pytest.mark.parametrize("last", [100, 40])
def test_a_client_waits_while_acknowledgements_go_on_coming(monkeypatch: pytest.MonkeyPatch, last: int) -> None:
    clock = [0.0]
    monkeypatch.setattr(client_module, "connected", lambda *_: nullcontext(Slow(clock, last)))
    monkeypatch.setattr(time, "monotonic", lambda: clock[0])
    with Client("tcp://127.0.0.1:5003", "press 7", 0.005) as client:
        client.send(np.zeros((100, 3)))
        if last == 100:
            client.wait_until_kept(timeout_s=30.0)
            assert client.acknowledged_index == 100
            return
        with pytest.raises(LiveClientError) as caught:
            client.wait_until_kept(timeout_s=30.0)
    assert str(caught.value) == (
        "session 'press 7': 60 samples are not acknowledged, and no acknowledgement came for 30 s; /readyz of the "
        "service states whether it can keep what comes"
    )


@pytest.fixture
def pauses(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """How long a client pauses, each time; only that takes time."""
    slept: list[float] = []
    monkeypatch.setattr(time, "monotonic", lambda: sum(slept))
    monkeypatch.setattr(time, "sleep", slept.append)
    return slept


def test_a_service_that_is_away_is_tried_often_at_first_and_then_each_second(
    pauses: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: Any) -> None:
        raise ConnectionRefusedError("refused")

    monkeypatch.setattr(client_module, "connected", refused)
    with pytest.raises(LiveClientError, match=r"^tcp://127.0.0.1:5003: not reached in 30 s \(refused\)$"):
        Client("tcp://127.0.0.1:5003", "press", 0.005)
    assert pauses[:10] == [0.05] * 10
    assert pauses[-1] == 1.0


def test_a_client_that_is_to_come_back_later_does(pauses: list[float], monkeypatch: pytest.MonkeyPatch) -> None:
    replies = [{"error": "too many", "retry_after_s": 2.0}, {"opened": {"handle": 1, "next_index": 7, "kept_index": 7}}]
    wire: Any = SimpleNamespace(window=None, send=lambda _: None, recv=lambda _: json.dumps(replies.pop(0)))
    monkeypatch.setattr(client_module, "connected", lambda *_: nullcontext(wire))
    assert Client("tcp://127.0.0.1:5003", "press", 0.005).next_index == 7
    assert pauses[0] == 2.0


def test_estimates_that_have_come_are_returned_at_once_also_behind_other_messages(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    estimates = pack_estimates(EstimateBlock(1, 0, 0.0, np.ones((20, 3)), np.zeros(20, np.uint32)))
    came: list[Any] = [
        json.dumps({"opened": {"handle": 1, "next_index": 0, "kept_index": 0}}),
        *[pack_acknowledgement(Acknowledgement(1, 0))] * 3,
        estimates,
    ]

    def recv(_: float) -> Any:
        if not came:
            raise TimeoutError
        return came.pop(0)

    wire: Any = SimpleNamespace(window=None, send=lambda _: None, recv=recv)
    monkeypatch.setattr(client_module, "connected", lambda *_: nullcontext(wire))
    client = Client("tcp://127.0.0.1:5003", "press", 0.005)
    assert len(client.estimates(timeout_s=0.0)[1]) == 20
    assert len(client.estimates(timeout_s=0.0)[1]) == 0


def test_an_address_of_no_known_kind_is_named() -> None:
    with pytest.raises(ValueError, match=r"'http://127.0.0.1': expected ws://HOST:PORT/stream, wss://..., tcp://"):
        connected("http://127.0.0.1")
