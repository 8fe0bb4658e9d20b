"""The processes of a server: this one, which watches and scores nothing, and its workers.

It imports little, as it mostly waits. What needs MLflow, finding a registered model and copying its files, is done by
a process that ends (``locating.py``).
"""

import logging
import os
import select
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from cylinder_friction.service.json_log import rotate
from cylinder_friction.service.scoring.locating import CURRENT_FILE, alias_moved
from cylinder_friction.service.scoring.settings import ServeSettings, ServingError

SETTINGS_FILE, METRICS_FOLDER = "settings.json", "metrics"
LOG_FORMAT = "%(asctime)s %(levelname)s %(message)s"
_TICK_S = 0.5
_POLL_S, _POLL_AFTER_FAILURE_S = 5.0, 60.0
_SILENT_S = 60.0
"""A worker that gave no sign of life for so long is killed."""
_END_S = 5.0
"""What a worker has for its end, besides the longest duration of a request."""
_LONGEST_PAUSE_S = 30.0
_BACKLOG = 1024

_log = logging.getLogger(__name__)


class _Worker:
    """A worker as its supervisor sees it: ``ready`` once it can be asked; it ends ``replaces`` then."""

    def __init__(self, listening: socket.socket, folder: Path, replaces: "_Worker | None" = None) -> None:
        self.replaces, self.ready, self.retired = replaces, False, False
        self._kill_at_s = time.monotonic() + _SILENT_S
        self._channel, theirs = socket.socketpair()
        self._channel.setblocking(False)
        with theirs:
            fds = (listening.fileno(), theirs.fileno())
            command = [sys.executable, "-m", "cylinder_friction.service.scoring.worker", *map(str, fds), str(folder)]
            self._process = _start(command, fds)
        self.pid = self._process.pid

    def listen(self) -> None:
        """Take its signs of life."""
        try:
            if self._channel.recv(1 << 12) and not self.retired:
                self.ready, self._kill_at_s = True, time.monotonic() + _SILENT_S
        except OSError:  # none there, or it has ended
            pass

    def retire(self, within_s: float) -> None:
        """Let it finish what it does, and end."""
        self.retired, self._kill_at_s = True, time.monotonic() + within_s
        self._process.terminate()

    def ended(self) -> str:
        """Return in words how it ended; empty while it runs. One that hangs is killed."""
        hangs = time.monotonic() > self._kill_at_s
        if hangs:
            self._process.kill()
            self._process.wait()
        status = self._process.poll()
        if status is None:
            return ""
        self._channel.close()
        if hangs:
            return "hung and was killed"
        return f"was ended by {signal.Signals(-status).name}" if status < 0 else f"ended with exit status {status}"


class Supervisor:
    """Keeps the workers of one server running, its model up to date and its access log small, until a signal.

    SIGTERM and SIGINT end it, after the requests that are being served. SIGHUP looks for the model and exchanges the
    workers one after the other, so that certificates are read again; it ends a server that was started in a terminal,
    which has closed. Workers end when their supervisor is gone, however that ended.
    """

    def __init__(self, settings: ServeSettings, locate: Sequence[str]) -> None:
        """Prepare a server; ``locate`` is a command that does what ``locating.locate`` does in its last argument."""
        self._settings, self._locate = settings, locate
        self._workers: list[_Worker] = []
        self._to_replace: list[_Worker] = []
        self._locating: subprocess.Popen[bytes] | None = None
        self._poll_at_s = self._rotate_at_s = self._start_at_s = self._pause_s = 0.0
        self._ends = self._announced = False

    def run(self, announce: Callable[[str, Path], None]) -> int:
        """Serve until a signal; ``announce`` gets the URL and the server's folder once all workers are ready.

        Raises:
            ServingError: The address cannot be listened on, or the model cannot be served.
        """
        signals = _Signals()
        listening = _listening(self._settings.host, self._settings.port)
        folder = Path(tempfile.mkdtemp(prefix="cylinder-friction-serve-"))
        try:
            if self._settings.workers > 1:
                (folder / METRICS_FOLDER).mkdir()
                self._settings = replace(self._settings, metrics_folder=folder / METRICS_FOLDER)
            (folder / SETTINGS_FILE).write_text(self._settings.to_json(), "utf-8")
            self._start_locating(folder)
            while not self._ends:
                self._take(signals.wait(_TICK_S), signals.in_terminal, folder)
                if self._find_model(folder):
                    self._keep_workers(listening, folder)
                if (
                    not self._announced
                    and len([each for each in self._workers if each.ready]) == self._settings.workers
                ):
                    announce(_url(self._settings, listening), folder)
                    self._announced = True
                if self._settings.access_log is not None and time.monotonic() > self._rotate_at_s:
                    self._rotate_at_s = time.monotonic() + _POLL_S
                    rotate(self._settings.access_log, self._settings.access_log_bytes, self._settings.access_log_files)
        finally:
            listening.close()
            self._end_all(signals)
            shutil.rmtree(folder, ignore_errors=True)
        return 0

    def _take(self, received: Sequence[int], in_terminal: bool, folder: Path) -> None:
        for number in received:
            name = signal.Signals(number).name
            if number == signal.SIGHUP and not in_terminal:
                _log.info("%s: looking for the model, exchanging the workers", name)
                self._to_replace = [each for each in self._workers if each.ready and not each.retired]
                if self._locating is None:
                    self._start_locating(folder)
            else:
                _log.info("%s: ending after the requests that are being served", name)
                self._ends = True

    def _start_locating(self, folder: Path) -> None:
        self._locating = _start([*self._locate, str(folder)])

    def _find_model(self, folder: Path) -> bool:
        """Look at the registry from time to time; return whether there is a model.

        Raises:
            ServingError: There is none at the start.
        """
        now_s, there = time.monotonic(), (folder / CURRENT_FILE).is_file()
        if self._locating is not None:
            status = self._locating.poll()
            if status is None:
                return there
            self._locating = None
            self._poll_at_s = now_s + (_POLL_AFTER_FAILURE_S if status else _POLL_S)
            there = (folder / CURRENT_FILE).is_file()
            if not there:
                raise ServingError("there is no model to serve; the message above states why")
            if status:
                _log.error("another model was found, but not taken (see above); the one in service stays")
        elif now_s > self._poll_at_s:
            self._poll_at_s = now_s + _POLL_S
            if alias_moved(folder):
                self._start_locating(folder)
        return there

    def _keep_workers(self, listening: socket.socket, folder: Path) -> None:
        """Start what is missing, exchange what shall be replaced, report what ended.

        Raises:
            ServingError: A worker ended before the server was ready.
        """
        for worker in list(self._workers):
            worker.listen()
            if how := worker.ended():
                self._workers.remove(worker)
                self._report(worker, how)
                for gauge in (folder / METRICS_FOLDER).glob(f"gauge_live*_{worker.pid}.db"):
                    gauge.unlink()  # what prometheus_client counts as long as a process lives
            elif worker.ready:
                self._pause_s = 0.0
                if worker.replaces is not None:
                    worker.replaces.retire(self._settings.timeout_s + _END_S)
                    worker.replaces = None
        self._to_replace = [each for each in self._to_replace if each in self._workers]
        in_exchange = any(each.retired or each.replaces for each in self._workers)
        if self._to_replace and not in_exchange and self._locating is None:
            self._workers.append(_Worker(listening, folder, self._to_replace.pop()))
        serving = [each for each in self._workers if not each.retired and each.replaces is None]
        if len(serving) < self._settings.workers and time.monotonic() >= self._start_at_s:
            missing = self._settings.workers - len(serving)
            self._workers += [_Worker(listening, folder) for _ in range(missing)]

    def _report(self, worker: _Worker, how: str) -> None:
        if worker.retired:
            if "killed" in how:
                _log.warning("worker %d %s", worker.pid, how)
        elif not self._announced:
            raise ServingError(f"a worker {how} before the server was ready; the message above states why")
        elif worker.replaces is not None:
            _log.error("worker %d %s before it was ready; worker %d stays", worker.pid, how, worker.replaces.pid)
            self._to_replace = []
        else:
            _log.error("worker %d %s; another takes its place in %.0f s", worker.pid, how, self._pause_s)
            self._start_at_s = time.monotonic() + self._pause_s
            self._pause_s = min(2.0 * self._pause_s + 1.0, _LONGEST_PAUSE_S)

    def _end_all(self, signals: "_Signals") -> None:
        """End every process that was started; another signal ends them at once."""
        if self._locating is not None:
            self._locating.kill()
            self._locating.wait()
        for worker in self._workers:
            worker.retire(self._settings.timeout_s + _END_S)
        while self._workers:
            if any(number != signal.SIGHUP for number in signals.wait(0.05)):
                for worker in self._workers:
                    worker.retire(0.0)
            for worker in list(self._workers):
                if how := worker.ended():
                    self._workers.remove(worker)
                    self._report(worker, how)


class _Signals:
    """SIGTERM, SIGINT and SIGHUP, to be waited for; SIGHUP stays ignored under ``nohup``."""

    def __init__(self) -> None:
        self._received: list[int] = []
        self._woken, wake = os.pipe()
        for end in (self._woken, wake):
            os.set_blocking(end, False)
        signal.set_wakeup_fd(wake, warn_on_full_buffer=False)
        numbers = [signal.SIGTERM, signal.SIGINT]
        if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:
            numbers.append(signal.SIGHUP)
        for number in numbers:
            signal.signal(number, lambda received, _: self._received.append(received))
        try:
            os.close(os.open("/dev/tty", os.O_RDONLY))
            self.in_terminal = True
        except OSError:
            self.in_terminal = False

    def wait(self, longest_s: float) -> list[int]:
        """Wait for a signal, but not longer; return what was received since the last call."""
        if select.select([self._woken], [], [], longest_s)[0]:
            os.read(self._woken, 1 << 10)
        received, self._received = self._received, []
        return received


def _start(command: Sequence[str], fds: Sequence[int] = ()) -> subprocess.Popen[bytes]:
    """Start a process that the terminal's Ctrl-C does not get to."""
    return subprocess.Popen(command, pass_fds=fds, stdin=subprocess.DEVNULL, start_new_session=True)  # noqa: S603


def _listening(host: str, port: int) -> socket.socket:
    try:
        family, *_, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0]
        return socket.create_server(address[:2], family=family, backlog=_BACKLOG)
    except OSError as error:
        reason = error.strerror if isinstance(error, socket.gaierror) else os.strerror(error.errno or 0)
        raise ServingError(
            f"{host}, port {port}: cannot be listened on ({reason}); end what listens there, or choose another "
            "with --host and --port (0: any free one)"
        ) from error


def _url(settings: ServeSettings, listening: socket.socket) -> str:
    """Return the address under which this machine reaches the server."""
    host = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(settings.host, settings.host)  # noqa: S104
    scheme = "http" if settings.tls_certificate is None else "https"
    return f"{scheme}://{f'[{host}]' if ':' in host else host}:{listening.getsockname()[1]}"
