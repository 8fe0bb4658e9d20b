"""A Dask cluster of real processes on this machine's loopback."""

import ctypes
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

import psutil

_LIBC = ctypes.CDLL(None)
PR_SET_PDEATHSIG = 1
SOURCE = Path(__file__).resolve().parents[1] / "src"


class LoopbackCluster:
    """A scheduler, which listens at ``address`` and wrote ``file``, and its workers; on Linux none outlives its parent.

    Args:
        folder: For the scheduler file, logs and what workers keep on disk.
        modules: Folders from which workers import, besides ``src``.
        settings: Of Dask, as environment variables.
    """

    def __init__(self, folder: Path, modules: tuple[Path, ...] = (), settings: Mapping[str, str] | None = None) -> None:
        self.folder, self.file, self.settings = folder, folder / "scheduler.json", settings or {}
        self.path = os.pathsep.join(map(str, (SOURCE, *modules)))
        self.processes: list[subprocess.Popen[bytes]] = []
        self.killed = 0
        scheme = "tls" if any("TLS" in name for name in self.settings) else "tcp"
        self._start("scheduler", "--host", f"{scheme}://127.0.0.1", "--port", "0", "--scheduler-file", str(self.file))
        while not self._written():
            if self.processes[0].poll() is not None:
                raise RuntimeError((self.folder / "scheduler0.log").read_text(encoding="utf-8"))
            time.sleep(0.05)

    def _written(self) -> bool:
        try:
            self.address = str(json.loads(self.file.read_text(encoding="utf-8"))["address"])
        except (FileNotFoundError, json.JSONDecodeError):  # not there, or not all of it
            return False
        return True

    def add_worker(self, *options: str) -> None:
        """Start a worker below a nanny, which starts it anew when it dies."""
        place = ["--host", "127.0.0.1", "--local-directory", str(self.folder / "space")]
        self._start("worker", *place, "--scheduler-file", str(self.file), *(options or ("--nthreads", "1")))

    def _start(self, what: str, *options: str) -> None:
        given = {
            "PYTHONPATH": self.path,
            "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "1",
            "DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT": "10s",  # so long a result is asked of a worker that has died
            **self.settings,
        }
        with (self.folder / f"{what}{len(self.processes)}.log").open("wb") as log:
            process = subprocess.Popen(
                [sys.executable, "-m", "dask", what, "--no-dashboard", "--dashboard-address", "127.0.0.1:0", *options],
                env={**os.environ, **given},
                stdout=log,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                preexec_fn=_end_with_parent if sys.platform == "linux" else None,
            )
        self.processes.append(process)

    def wait_until_registered(self, worker: int, times: int = 1) -> None:
        """Wait until a worker has registered so many times; killed while it starts, it would take its nanny with it."""
        log = self.folder / f"worker{worker}.log"
        while log.read_text(encoding="utf-8").count("Registered to:") < times:
            if self.processes[worker].poll() is not None:
                raise RuntimeError(log.read_text(encoding="utf-8"))
            time.sleep(0.05)

    def kill_worker(self) -> None:
        """Kill the process that works below the last nanny, which starts it anew."""
        last = len(self.processes) - 1
        self.wait_until_registered(last, self.killed + 1)
        below = psutil.Process(self.processes[last].pid).children(recursive=True)
        next(each for each in below if any("spawn_main" in argument for argument in each.cmdline())).kill()
        self.killed += 1

    def stop(self) -> None:
        for process in self.processes:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def _end_with_parent() -> None:
    """Have the kernel kill this process when its parent ends, however that ends."""
    _LIBC.prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


@contextmanager
def loopback_cluster(
    folder: Path, workers: int = 2, modules: tuple[Path, ...] = (), settings: Mapping[str, str] | None = None
) -> Iterator[LoopbackCluster]:
    """Yield a cluster, and end its processes afterwards."""
    cluster = LoopbackCluster(folder, modules, settings)
    try:
        for number in range(1, workers + 1):
            cluster.add_worker()
            cluster.wait_until_registered(number)
        yield cluster
    finally:
        cluster.stop()
