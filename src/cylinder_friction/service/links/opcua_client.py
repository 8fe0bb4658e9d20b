"""Samples by OPC UA: nodes of other servers, as arrays of samples or value by value."""

import asyncio
import json
import logging
import math
import threading
import time
from collections import Counter
from collections.abc import AsyncIterator, Callable, Coroutine
from concurrent.futures import Future
from contextlib import asynccontextmanager
from functools import partial
from typing import Any

import numpy as np
from asyncua import Client, ua
from asyncua.crypto.security_policies import SecurityPolicyBasic256Sha256

from cylinder_friction.arrays import Array
from cylinder_friction.service.links.link import Link, in_background
from cylinder_friction.service.live.connection import Connection, Peers
from cylinder_friction.service.live.frames import LARGEST_INDEX, SampleBlock, pack_samples
from cylinder_friction.service.live.service import LiveService
from cylinder_friction.service.live.settings import OpcUaClientSettings, OpcUaSource

RETRY_S, FLUSH_S, PATIENCE_S = 1.0, 0.02, 1.0
UNTAKEN_BLOCKS = 5000
"""Blocks of one source that wait for the service; beyond it the newest are dropped and counted."""
ROWS_A_BLOCK = 1000
_OVERFLOW = 0x480
"""Bits of a status code by which a server states that its queue has lost values."""
_Block = tuple[int, float, Array]
_Put = Callable[[int, float, Array], None]
_log = logging.getLogger(__name__)
logging.getLogger("asyncua").setLevel(logging.WARNING)


class OpcUaClientLink(Link):
    """Subscriptions to a server's nodes, in a thread of their own, each source a session."""

    name = "opcua client"

    def __init__(self, settings: OpcUaClientSettings) -> None:
        super().__init__(settings.url)
        self._settings = settings

    @asynccontextmanager
    async def running(self, service: LiveService, peers: Peers) -> AsyncIterator[None]:
        """Subscribe, again and again where the server is not there."""
        senders = [_Sender(each.session, service, self.counts) for each in self._settings.sources]
        connections = (Connection(sender, service, peers).run() for sender in senders)
        inputs, sample_time_s, hold_s = service.engine.inputs, service.engine.sample_time_s, service.rules.hold_s
        readers = [
            _SourceReader(source, inputs, sample_time_s, hold_s, self.counts, sender.put)
            for source, sender in zip(self._settings.sources, senders, strict=True)
        ]
        async with in_background(*connections), _in_own_loop(self.name, self._follow(readers)):
            yield

    async def _follow(self, readers: list["_SourceReader"]) -> None:
        while True:
            connected_before = self.counts["connected"]
            try:
                await self._subscribe(readers)
            except Exception as error:  # the library has many for a broken connection, StopAsyncIteration among them
                self.counts["broken"] += 1
                if connected_before != self.counts["connected"] or self.counts["broken"] == 1:  # the first of a row
                    _log.warning("%s: %s (%s); trying again", self.address, error, type(error).__name__)
            await asyncio.sleep(RETRY_S)

    async def _subscribe(self, readers: list["_SourceReader"]) -> None:
        """Follow all nodes until the connection breaks."""
        settings = self._settings
        client = Client(settings.url)
        if settings.certificate is not None and settings.private_key is not None:
            await client.set_security(SecurityPolicyBasic256Sha256, settings.certificate, settings.private_key)
        if settings.user is not None and settings.password_file is not None:
            client.set_user(settings.user)
            client.set_password(settings.password_file.read_text(encoding="utf-8").strip())
        async with client:
            subscription = await client.create_subscription(settings.publishing_ms, queue_maxsize=UNTAKEN_BLOCKS)
            takers = [taker for reader in readers for taker in reader.nodes()]
            asked = [
                _request(number, node, sampling_ms, settings.queue)
                for number, (node, sampling_ms, _) in enumerate(takers)
            ]
            for (node, _, _), result in zip(takers, await subscription.create_monitored_items(asked), strict=True):
                if isinstance(result, ua.StatusCode):
                    raise ua.UaError(f"node {node} cannot be followed ({result.name})")
            self.counts["connected"] += 1
            flushed_s = 0.0
            while True:
                event = await subscription.next_event(timeout=FLUSH_S)
                now_s = time.monotonic()
                if event is not None:
                    item = event.data.monitored_item
                    if item.Value.StatusCode is not None and item.Value.StatusCode.value & _OVERFLOW == _OVERFLOW:
                        self.counts["overflow"] += 1
                    takers[item.ClientHandle][2](item.Value, now_s)
                if event is None or now_s - flushed_s > FLUSH_S:
                    flushed_s = now_s
                    await client.check_connection()
                    for reader in readers:
                        reader.flush(now_s)


class _SourceReader:
    """One source: what its nodes give, as blocks for the service."""

    def __init__(
        self,
        source: OpcUaSource,
        inputs: tuple[str, ...],
        sample_time_s: float,
        hold_s: float,
        counts: Counter[str],
        put: _Put,
    ) -> None:
        self._source, self._inputs, self._sample_time_s = source, inputs, sample_time_s
        self._counts, self._put = counts, put
        self._grid = ServerGrid(sample_time_s, len(inputs), hold_s, counts)
        if source.inputs and set(source.inputs) != set(inputs):
            raise ValueError(
                f"opcua_client.sources: session {source.session!r} has nodes for {sorted(source.inputs)}; the model "
                f"takes {list(inputs)}"
            )

    def nodes(self) -> list[tuple[str, float, Callable[[Any, float], None]]]:
        """Return nodes to follow, their sampling interval [ms], and what takes their values."""
        if self._source.samples is not None:
            return [(self._source.samples, self._source.sampling_ms, self._take_array)]
        return [
            (self._source.inputs[name], self._source.sampling_ms, partial(self._take_value, place))
            for place, name in enumerate(self._inputs)
        ]

    def flush(self, now_s: float) -> None:
        """Give the rows that are complete, or have waited long enough."""
        for index, rows in self._grid.take(now_s):
            self._give(index, index * self._sample_time_s, rows)

    def _take_value(self, place: int, value: Any, now_s: float) -> None:
        bad = value.StatusCode is not None and value.StatusCode.is_bad()
        if value.Value.Value is None and not bad:
            return  # nothing yet
        if value.SourceTimestamp is None:
            self._counts["without a time"] += 1
            return
        number = math.nan if bad else float(value.Value.Value)
        self._grid.put(place, value.SourceTimestamp.timestamp(), number, now_s)

    def _take_array(self, value: Any, now_s: float) -> None:
        del now_s
        content = value.Value.Value
        numbers = np.asarray([] if content is None else content, dtype=np.float64).ravel()
        columns = len(self._inputs)
        if not len(numbers):
            return  # nothing yet
        index = numbers[0]
        if len(numbers) % columns != 1 % columns or len(numbers) == 1 or not 0 <= index < LARGEST_INDEX or index % 1:
            self._counts["no samples"] += 1
            return
        time_s = time.time() if value.SourceTimestamp is None else value.SourceTimestamp.timestamp()
        self._give(int(index), time_s, numbers[1:].reshape(-1, columns))

    def _give(self, index: int, time_s: float, rows: Array) -> None:
        for begin in range(0, len(rows), ROWS_A_BLOCK):
            self._put(index + begin, time_s + begin * self._sample_time_s, rows[begin : begin + ROWS_A_BLOCK])


class _Sender:
    """The client's side of a connection to the service, in the service's own process."""

    def __init__(self, session: str, service: LiveService, counts: Counter[str]) -> None:
        self._session, self._service, self._counts = session, service, counts
        opens = {"session": session, "inputs": service.engine.inputs, "sample_time_s": service.engine.sample_time_s}
        self._opens = json.dumps({"open": opens})
        self._blocks: asyncio.Queue[_Block] = asyncio.Queue(UNTAKEN_BLOCKS)
        self._loop = asyncio.get_running_loop()
        self._next: _Block | None = None
        self._handle, self._asked, self._lost, self._replied = 0, False, False, asyncio.Event()

    def put(self, index: int, time_s: float, rows: Array) -> None:
        """Queue a block for the service, from any thread."""
        self._loop.call_soon_threadsafe(self._queue, (index, time_s, rows))

    def _queue(self, block: _Block) -> None:
        try:
            self._blocks.put_nowait(block)
        except asyncio.QueueFull:
            self._counts["dropped"] += len(block[2])

    async def receive(self) -> bytes | str:
        """Return the next message for the service; a session that is not open is opened first."""
        while self._next is None or self._lost:
            self._next = await self._blocks.get()
            self._counts["dropped"] += len(self._next[2]) * self._lost
        while not self._is_open():
            if not self._asked:
                self._asked = True
                return self._opens
            self._replied.clear()
            await self._replied.wait()
        (index, time_s, rows), self._next = self._next, None
        return pack_samples(SampleBlock(self._handle, index, time_s, rows))

    async def send(self, message: bytes | str) -> None:
        """Take what the service replies; estimates are not for this side."""
        if isinstance(message, bytes):
            return
        content = json.loads(message)
        if "opened" in content:
            self._handle, self._asked = content["opened"]["handle"], False
        elif "lost" in content:
            self._lost = True
            _log.warning("session %s: by OPC UA no more, another connection has opened it", self._session)
        elif "error" in content and not self._lost:
            self._counts["refused"] += 1
            _log.warning("session %s, by OPC UA: %s", self._session, content["error"])
            await asyncio.sleep(RETRY_S)
            self._asked = False
        self._replied.set()

    def _is_open(self) -> bool:
        session = self._service.sessions.get(self._session)
        return session is not None and session.handle == self._handle


def _request(number: int, node: str, sampling_ms: float, queue: int) -> Any:
    """Return what asks for every value of a node, also one that repeats the last with a new time."""
    request = ua.MonitoredItemCreateRequest()
    request.ItemToMonitor = ua.ReadValueId(ua.NodeId.from_string(node), ua.AttributeIds.Value)
    request.MonitoringMode = ua.MonitoringMode.Reporting
    request.RequestedParameters = ua.MonitoringParameters(
        ClientHandle=number, SamplingInterval=sampling_ms, QueueSize=queue, DiscardOldest=True,
        Filter=ua.DataChangeFilter(Trigger=ua.DataChangeTrigger.StatusValueTimestamp),
    )  # fmt: skip
    return request


@asynccontextmanager
async def _in_own_loop(name: str, job: Coroutine[Any, Any, None]) -> AsyncIterator[None]:
    """Run a job in an event loop and a thread of its own; cancel it when the context ends."""
    started: Future[tuple[asyncio.AbstractEventLoop, asyncio.Task[None]]] = Future()

    async def main() -> None:
        task = asyncio.create_task(job)
        started.set_result((asyncio.get_running_loop(), task))
        await asyncio.gather(task, return_exceptions=True)

    thread = threading.Thread(target=lambda: asyncio.run(main()), name=name, daemon=True)
    thread.start()
    loop, task = await asyncio.wrap_future(started)
    try:
        yield
    finally:
        if thread.is_alive():
            loop.call_soon_threadsafe(task.cancel)
            await asyncio.to_thread(thread.join, PATIENCE_S)


class ServerGrid:
    """Rows of one session, from values that come one by one, each with its own time.

    A row's index is its time since 1970 in sample times, so that a new start of anything goes on by itself. A row is
    given once all its inputs are there, or when ``hold_s`` has passed since its first; inputs that did not come are no
    numbers then. Rows of which nothing came are not given: the session finds the gap by its index.

    Args:
        sample_time_s: Time between two rows [s].
        columns: Inputs of a row.
        hold_s: How long a row waits for the rest of its inputs [s].
        counts: ``values``, ``doubled`` (its row had one already: time stamps jitter, or come too fast),
            ``late`` (its row had been given) and ``incomplete`` (rows with inputs that did not come).
    """

    def __init__(self, sample_time_s: float, columns: int, hold_s: float, counts: Counter[str]) -> None:
        self._sample_time_s, self._columns, self._hold_s, self._counts = sample_time_s, columns, hold_s, counts
        self._rows: dict[int, tuple[Array, set[int], float]] = {}  # Values, missing columns, since when [s]
        self._given = -1

    def put(self, column: int, time_s: float, value: float, now_s: float) -> None:
        """Take a value in; one that is no number stands for a bad status."""
        index = math.floor(time_s / self._sample_time_s + 0.5)
        self._counts["values"] += 1
        if index <= self._given:
            self._counts["late"] += 1
            return
        if index not in self._rows:
            self._rows[index] = np.full(self._columns, np.nan), set(range(self._columns)), now_s
        row, missing, _ = self._rows[index]
        if column not in missing:
            self._counts["doubled"] += 1
        missing.discard(column)
        row[column] = value

    def take(self, now_s: float) -> list[tuple[int, Array]]:
        """Return what can be given, as runs of successive rows: index of the first, samples ``(rows, columns)``."""
        runs: list[tuple[int, list[Array]]] = []
        for index in sorted(self._rows):
            row, missing, since_s = self._rows[index]
            if missing and now_s - since_s < self._hold_s:
                break
            self._counts["incomplete"] += bool(missing)
            if runs and runs[-1][0] + len(runs[-1][1]) == index:
                runs[-1][1].append(row)
            else:
                runs.append((index, [row]))
            self._given = index
            del self._rows[index]
        return [(index, np.stack(rows)) for index, rows in runs]
