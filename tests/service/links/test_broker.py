"""The connection to a broker."""

import asyncio

import pytest

from cylinder_friction.service.links import broker as module
from cylinder_friction.service.links.broker import Broker, Message
from cylinder_friction.service.live.settings import BrokerSettings
from live_process import Mosquitto, needs_broker


@needs_broker
def test_it_ends_also_where_the_connection_closes_in_the_same_moment(
    broker: Mosquitto, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A cancellation beside a result is lost by ``asyncio.wait_for`` of Python 3.11: the service ran on and on then."""
    monkeypatch.setattr(module, "_MISC_S", 0.03)

    async def begin_and_end() -> None:
        loop, connected = asyncio.get_running_loop(), asyncio.Event()
        settings, last = BrokerSettings(port=broker.port), Message("last", "word")
        link = Broker(settings, "client", lambda _: connected.set(), lambda _: None, lambda: last)
        close = link._client.disconnect
        monkeypatch.setattr(link._client, "disconnect", lambda: loop.call_later(0.05, close))
        async with link.running(lambda: last):
            await connected.wait()

    async def twice() -> None:
        for _ in range(2):
            async with asyncio.timeout(60.0):
                await begin_and_end()

    asyncio.run(twice())
