"""A client that misses estimates on their way asks for them again, and knows which addresses it can use."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from cylinder_friction.live import client as client_module
from cylinder_friction.live.client import Client
from cylinder_friction.live.client_sockets import connected
from cylinder_friction.live.frames import EstimateBlock, unpack
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


def test_an_address_of_no_known_kind_is_named() -> None:
    with pytest.raises(ValueError, match=r"'http://127.0.0.1': expected ws://HOST:PORT/stream, wss://..., tcp://"):
        connected("http://127.0.0.1")
