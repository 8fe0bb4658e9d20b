"""What one client may take of a service: connections, pace, sizes; and what is written down of it."""

import asyncio
import json
from contextlib import closing, suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cylinder_friction.arrays import Array
from cylinder_friction_live import connection
from cylinder_friction_live.connection import BURST_S, ClientGoneError, Connection, Pace, Peers
from cylinder_friction_live.events import Events
from cylinder_friction_live.frames import SampleBlock, pack_samples
from cylinder_friction_live.service import BusyError, LiveService
from cylinder_friction_live.settings import LiveLimits
from live_process import keep


class Wire:
    """A client's end: gives the messages it is made of, then leaves, or ``stays``; ``stalled`` it reads nothing."""

    def __init__(self, *messages: bytes | str, stalled: bool = False, stays: bool = False) -> None:
        self.messages, self.stalled, self.stays = list(messages), stalled, stays
        self.leaving = asyncio.Event()
        self.got: list[bytes | str] = []
        self.reading = asyncio.Event()

    async def receive(self) -> bytes | str:
        await asyncio.sleep(0)
        if not self.messages:
            await (self.leaving.wait() if self.stays else asyncio.sleep(0.05))
            raise ClientGoneError
        return self.messages.pop(0)

    async def send(self, message: bytes | str) -> None:
        if self.stalled:
            await self.reading.wait()
        self.got.append(message)


class AtOnce(Wire):
    """A client's end whose messages have all come."""

    async def receive(self) -> bytes | str:
        return self.messages.pop(0) if self.messages else await super().receive()


class Cut(AtOnce):
    """A client's end that broke: as with a socket, that is noticed in the turn of the loop after the first write."""

    def __init__(self, *messages: bytes | str) -> None:
        super().__init__(*messages)
        self.noticed = False

    async def send(self, message: bytes | str) -> None:
        if self.noticed:
            raise ClientGoneError
        asyncio.get_running_loop().call_soon(setattr, self, "noticed", True)
        self.got.append(message)


def opening(name: str = "press") -> str:
    inputs = ["pressure_1_pa", "pressure_2_pa", "position_m"]
    return json.dumps({"open": {"session": name, "inputs": inputs, "sample_time_s": 0.005}})


def errors(wire: Wire) -> list[str]:
    return [str(json.loads(each).get("error", "")) for each in wire.got if isinstance(each, str)]


def test_one_client_too_many_is_sent_away_until_another_leaves(service: LiveService) -> None:
    service.limits = LiveLimits(connections=1)

    async def scenario() -> tuple[Wire, Wire]:
        peers = Peers()
        one = Wire(opening(), stays=True)
        first = asyncio.create_task(Connection(one, service, peers).run())
        await asyncio.sleep(0.01)
        second, third = Wire(opening()), Wire(opening())
        await Connection(second, service, peers).run()
        one.leaving.set()
        await first
        await Connection(third, service, peers).run()
        assert peers.refused["connections"] == 1
        assert len(peers.connected) == 0
        return second, third

    second, third = asyncio.run(scenario())
    assert errors(second) == ["1 clients are connected, all that are taken; try later"]
    assert json.loads(second.got[0])["retry_after_s"] > 0.0
    assert errors(third) == [""]


def test_limits_of_one_user_and_of_one_connection_leave_room_for_others(service: LiveService) -> None:
    service.limits = LiveLimits(connections_per_user=2, sessions_per_user=3, sessions_per_connection=2)
    peers = Peers()

    async def scenario() -> list[Wire]:
        wires = [Wire(*map(opening, names), stays=True) for names in ("abc", "de", "f", "gh")]
        users = ("one", "one", "one", "other")
        running = [
            asyncio.create_task(Connection(wire, service, peers, user=user).run())
            for wire, user in zip(wires, users, strict=True)
        ]
        await asyncio.sleep(0.1)
        for wire in wires:
            wire.leaving.set()
        await asyncio.gather(*running)
        return wires

    one, second, third, other = asyncio.run(scenario())
    assert errors(one)[:2] == ["", ""]
    assert "'c': this connection has 2 sessions, all that one may have" in errors(one)[2]
    assert errors(second) == ["", "session 'e': this user has 3 sessions, all that one may have; try later"]
    assert errors(third) == ["2 clients of this user are connected, all that are taken; try later"]
    assert errors(other) == ["", ""]


def test_under_load_long_json_and_new_sessions_are_refused(service: LiveService, samples: Array) -> None:
    service.limits, peers = LiveLimits(text_bytes=500), Peers()
    frame = pack_samples(SampleBlock(1, 0, 0.0, samples[:10]))
    asyncio.run(Connection(Wire(opening(), frame), service, peers).run())
    keep(service)
    again = LiveService(service.engine, service.journal, limits=service.limits)
    again.loop_lag_s = 0.3
    wire = Wire(opening(), opening("other"), " " * 501)
    asyncio.run(Connection(wire, again, peers).run())
    assert errors(wire) == [
        "",
        "session 'other': new sessions are refused while the service is 0.30 s late",
        "got 501 bytes of JSON, expected at most 500; send frames",
    ]
    assert [("retry_after_s" in json.loads(each)) for each in wire.got] == [False, True, False]
    assert peers.refused[BusyError.__name__] == 1


def test_a_client_that_is_gone_is_written_to_once_however_many_messages_it_left(service: LiveService) -> None:
    wire = Cut(*["no JSON"] * 1000)
    asyncio.run(Connection(wire, service, Peers()).run())
    assert len(wire.got) == 1


def test_others_have_their_turn(service: LiveService, samples: Array, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection, "TURN_S", 0.0)
    wire = AtOnce(opening(), *[pack_samples(SampleBlock(1, 10 * at, 0.0, samples[:10])) for at in range(100)])

    async def scenario() -> int:
        taking = asyncio.create_task(Connection(wire, service, Peers()).run())
        for _ in range(10):
            await asyncio.sleep(0)
        left = len(wire.messages)
        await taking
        return left

    assert asyncio.run(scenario()) > 50


def test_a_client_may_catch_up_after_a_break_and_is_then_slowed() -> None:
    pace = Pace(rows_per_s=100.0)
    pace.count(int(100 * BURST_S), now_s=50.0)
    assert not pace.is_ahead(50.0)
    pace.count(100, 50.0)
    assert pace.is_ahead(50.9)
    assert not pace.is_ahead(51.1)


def test_what_waits_is_bounded(service: LiveService, samples: Array, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is not read from any more; what waits is the bound and one message's estimates at most."""
    monkeypatch.setattr(connection, "UNSENT_BYTES", 20_000)
    rows, count = 100, 60
    frames = [pack_samples(SampleBlock(1, rows * at, 0.0, samples[:rows])) for at in range(count)]
    wire = Wire(opening(), *frames, stalled=True)

    async def scenario() -> tuple[int, int]:
        client = Connection(wire, service, Peers())
        running = asyncio.create_task(client.run())
        await asyncio.sleep(0.3)
        waiting, left = client.unsent, len(wire.messages)
        wire.reading.set()
        await running
        return waiting, left

    waiting, left = asyncio.run(scenario())
    one_message = rows * 28 + 24
    assert 20_000 < waiting <= 20_000 + one_message + 1000
    assert left > 0
    assert sum(len(each) for each in wire.got if isinstance(each, bytes)) == count * one_message


def test_a_client_learns_why_its_session_begins_anew(service: LiveService, samples: Array, tmp_path: Path) -> None:
    frame = pack_samples(SampleBlock(1, 0, 0.0, samples[:10]))
    asyncio.run(Connection(Wire(opening(), frame), service, Peers()).run())
    keep(service)
    saved = service.journal.session("press")
    assert saved is not None
    service.journal.keep([replace(saved, model="f" * 64)], [])
    after, path = LiveService(service.engine, service.journal), tmp_path / "log"
    wire = Wire(opening())
    with closing(Events(path)) as events:
        asyncio.run(Connection(wire, after, Peers(events)).run())
    words = f"the session was kept by model ffffffffffff, and the service runs {service.engine.model[:12]}"
    opened = json.loads(wire.got[0])["opened"]
    assert (opened["next_index"], opened["begins_anew"]) == (10, words)
    assert json.loads(path.read_text("utf-8"))["begins_anew"] == words


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full")
def test_a_full_disk_ends_no_log_and_is_named_once(caplog: pytest.LogCaptureFixture) -> None:
    with closing(Events(Path("/dev/full"))) as events:
        for _ in range(3):
            events.note("session opened", session="press")
    (record,) = caplog.records
    assert record.message.startswith("/dev/full: nothing is logged (")
    assert record.exc_info is None


def test_what_happens_is_written_down(service: LiveService, samples: Array, tmp_path: Path) -> None:
    path, service.limits = tmp_path / "live.jsonl", LiveLimits(connections=2)
    frame = pack_samples(SampleBlock(1, 0, 0.0, np.ascontiguousarray(samples[:10])))

    async def scenario() -> None:
        peers = Peers(Events(path))
        one = Wire(opening(), frame, stays=True)
        first = asyncio.create_task(Connection(one, service, peers, "one").run())
        await asyncio.sleep(0.01)
        await Connection(Wire(opening()), service, peers, "two").run()
        one.leaving.set()
        await first
        session, service.loop_lag_s = service.sessions["press"], 0.5
        watching = asyncio.create_task(peers.events.watch(service))
        await asyncio.sleep(0.1)
        session.order.counts.resets += 1
        await asyncio.sleep(1.2)
        watching.cancel()
        with suppress(asyncio.CancelledError):
            await watching
        peers.events.close()

    asyncio.run(scenario())
    lines = [json.loads(line) for line in path.read_text("utf-8").splitlines()]
    assert all(line.pop("time").endswith("+00:00") for line in lines)
    known = {"session": "press"}
    assert lines[0] == {"event": "session opened", **known, "index": 0, "client": "one"}
    assert lines[1] == {"event": "session resumed", **known, "index": 10, "client": "two"}
    assert lines[2] == {"event": "session lost", **known, "client": "one", "to": "two"}
    assert [line["event"] for line in lines[3:6]] == ["slow loop", "session reset", "slow loop"]
