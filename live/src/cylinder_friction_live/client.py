"""A client that loses no sample: it keeps samples until they are acknowledged, and sends them again after a break."""

import json
import time
import weakref
from collections import deque
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction_live.client_sockets import ClientSocket, LiveClientError, connected
from cylinder_friction_live.frames import Acknowledgement, EstimateBlock, SampleBlock, pack_samples, unpack

SOONEST_S, LATEST_S, PATIENCE_S = 0.05, 1.0, 30.0
"""Shortest and longest pause between two tries to reach a service [s], and the time after which tries end [s]. A pause
is a tenth of the time since the break."""
ROWS_A_BLOCK = 1000


class Client:
    """Sends samples of one session to the service and receives estimates, in order and once each.

    After a break it connects again and repeats the samples that were not acknowledged; a restarted sender continues at
    ``next_index``. One client is for one thread. The service drops a WebSocket whose client is not called for two
    minutes; the client then connects again at its next call.

    Args:
        url: Address of the service: ``ws://127.0.0.1:5002/stream`` or
            ``mqtt://127.0.0.1:1883/cylinder-friction/CLIENT`` with a CLIENT that no other client uses.
        session: Name of the cylinder's session, the same after every start.
        sample_time_s: Time between two samples [s].
        inputs: Columns of a sample, as the model names them.
        token: Token with the role ``write``, if the service has tokens.
        ca: PEM file of the authority that signed the service's certificate, or of the certificate itself; None: the
            machine's authorities.
        start_time_s: Time of the sample with index 0 [s, Unix]; None: now, less the duration that was sent before.

    Attributes:
        begins_anew: Why this client's session began anew instead of resuming; empty if it resumed.

    Raises:
        LiveClientError: The service refuses the session, or does not respond within half a minute.
    """

    def __init__(
        self,
        url: str,
        session: str,
        sample_time_s: float,
        inputs: Sequence[str] = ("pressure_1_pa", "pressure_2_pa", "position_m"),
        start_time_s: float | None = None,
        token: str = "",
        ca: Path | None = None,
    ) -> None:
        self._url, self._session = url, session
        self._opens: dict[str, Any] = {"session": session, "inputs": list(inputs), "sample_time_s": sample_time_s}
        self._sample_time_s = sample_time_s
        self._token, self._ca = token, ca
        self._unacknowledged: deque[SampleBlock] = deque()
        self._estimates: deque[EstimateBlock] = deque()
        self._skipped: list[tuple[int, int]] = []  # First index, and the one after the last
        self._socket: ClientSocket | None = None
        self._open_socket = ExitStack()
        weakref.finalize(self, self._open_socket.close)  # also at exit, before the modules it needs are gone
        self._handle, self.acknowledged_index, self._asked_from = 0, 0, -1
        self.next_index = self.estimated_index = self._connect()
        self.start_time_s = time.time() - self.next_index * sample_time_s if start_time_s is None else start_time_s

    def send(self, samples: Array) -> None:
        """Send successive samples, shape ``(rows, inputs)``; returns once they are sent, before they are acknowledged.

        Estimates that come meanwhile wait for ``estimates``.
        """
        for begin in range(0, len(samples), ROWS_A_BLOCK):
            time_s = self.start_time_s + self.next_index * self._sample_time_s
            self._wait_for_room()
            part = np.asarray(samples[begin : begin + ROWS_A_BLOCK], np.float64)
            block = SampleBlock(self._handle, self.next_index, time_s, part)
            self._unacknowledged.append(block)
            self.next_index += block.rows
            self._send(block)

    def skip(self, rows: int) -> None:
        """Skip samples that were not taken; after more than a short gap the session begins anew."""
        self._skipped = [each for each in self._skipped if each[1] > self.estimated_index]
        self._skipped.append((self.next_index, self.next_index + rows))
        self.next_index += rows

    def estimates(self, timeout_s: float = 1.0) -> tuple[int, Array, NDArray[np.uint32]]:
        """Wait for estimates: index of the first, newtons ``(rows, 3)``, flags; no rows after ``timeout_s``."""
        deadline = time.monotonic() + timeout_s
        left_s = timeout_s
        while not self._estimates and self._receive(left_s):  # messages that have come are read even after the timeout
            left_s = max(0.0, deadline - time.monotonic())
        if not self._estimates:
            return self.estimated_index, np.zeros((0, 3)), np.zeros(0, np.uint32)
        block = self._estimates.popleft()
        return block.index, block.newtons, block.flags

    def wait_until_kept(self, timeout_s: float = 30.0) -> None:
        """Wait until all sent samples are acknowledged, as long as acknowledgements keep coming.

        Estimates that come meanwhile wait for ``estimates``.

        Raises:
            LiveClientError: No acknowledgement came for ``timeout_s``.
        """
        known, deadline = self.acknowledged_index, time.monotonic() + timeout_s
        while self._unacknowledged:
            self._receive(0.2)
            if self.acknowledged_index > known:
                known, deadline = self.acknowledged_index, time.monotonic() + timeout_s
            elif time.monotonic() > deadline:
                rows = sum(min(each.rows, each.index + each.rows - known) for each in self._unacknowledged)
                raise LiveClientError(
                    f"session {self._session!r}: {rows} samples are not acknowledged, and no acknowledgement came for "
                    f"{timeout_s:g} s; /readyz of the service states whether it can keep what comes"
                )

    def close(self) -> None:
        """Disconnect; the service keeps the session, which a later client can continue."""
        self._socket = None
        self._open_socket.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def _connect(self) -> int:
        """Open the session; return the index that the service steps next."""
        begun_s = time.monotonic()
        while True:
            try:
                self._open_socket.close()
                self._socket = self._open_socket.enter_context(connected(self._url, self._token, self._ca))
                self._socket.send(json.dumps({"open": self._opens}))
                opened = self._opened(self._socket)
                break
            except OSError as error:
                away_s = time.monotonic() - begun_s
                if away_s > PATIENCE_S:
                    raise LiveClientError(f"{self._url}: not reached in {PATIENCE_S:g} s ({error})") from error
                time.sleep(min(max(SOONEST_S, 0.1 * away_s), LATEST_S))
        self._handle, self.begins_anew = opened["handle"], str(opened.get("begins_anew", ""))
        self.acknowledged_index = max(self.acknowledged_index, opened["kept_index"])
        return int(opened["next_index"])

    def _opened(self, socket: ClientSocket) -> dict[str, Any]:
        while True:
            message = socket.recv(5.0)
            content = json.loads(message) if isinstance(message, str) else {}
            if "retry_after_s" in content:
                time.sleep(content["retry_after_s"])
                raise ConnectionError(content["error"])
            if "error" in content:
                raise LiveClientError(content["error"])
            if "opened" in content:
                return dict(content["opened"])

    def _wait_for_room(self) -> None:
        window = None if self._socket is None else self._socket.window
        while window is not None and len(self._unacknowledged) >= window:
            self._receive(0.2)

    def _send(self, block: SampleBlock) -> None:
        try:
            assert self._socket is not None
            self._socket.send(pack_samples(block))
        except OSError:
            self._resume()

    def _resume(self) -> None:
        """Connect again, ask for unread estimates, and send the samples that were not acknowledged."""
        self._opens["estimates_from"] = self.estimated_index
        self._connect()
        self._forget_acknowledged()
        blocks = [SampleBlock(self._handle, b.index, b.time_s, b.content, b.columns) for b in self._unacknowledged]
        self._unacknowledged = deque(blocks)
        for block in blocks:
            try:
                assert self._socket is not None
                self._socket.send(pack_samples(block))
            except OSError:
                return self._resume()
        return None

    def _receive(self, timeout_s: float) -> bool:
        """Process the next message; return whether one came, or the connection was made anew."""
        try:
            assert self._socket is not None
            message = self._socket.recv(timeout_s)
        except TimeoutError:
            return False
        except OSError:
            self._resume()
            return True
        if isinstance(message, str):
            if message.startswith('{"opened"'):
                return True  # MQTT may bring a message twice
            raise LiveClientError(message)
        for block in unpack(message):
            if isinstance(block, Acknowledgement):
                self.acknowledged_index = max(self.acknowledged_index, block.index)
                self._forget_acknowledged()
            elif isinstance(block, EstimateBlock):
                for first, after in self._skipped:
                    if first == self.estimated_index and after <= block.index:
                        self.estimated_index = after  # nothing was lost
                if block.index > self.estimated_index != self._asked_from:
                    self._asked_from = self.estimated_index  # only once: after a long gap the service may have none
                    self._resume()
                    return True
                self._take(block)
        return True

    def _take(self, block: EstimateBlock) -> None:
        """Keep new estimates; after a break the service repeats estimates that it had not kept."""
        known = max(0, self.estimated_index - block.index)
        if known < len(block):
            self._estimates.append(block.after(known, self._sample_time_s))
            self.estimated_index = block.index + len(block)

    def _forget_acknowledged(self) -> None:
        while self._unacknowledged:
            first = self._unacknowledged[0]
            if first.index + first.rows > self.acknowledged_index:
                return
            self._unacknowledged.popleft()
