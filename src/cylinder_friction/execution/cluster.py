"""Work on a Dask cluster: workers of one thread each, with the code, libraries and processor of their neighbours."""

from __future__ import annotations

import hashlib
import os
import platform
from collections.abc import Callable, Mapping
from concurrent.futures import CancelledError, Executor, Future
from dataclasses import dataclass
from functools import cache, partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import numba
from tqdm import tqdm

from cylinder_friction.execution.workers import ONE_THREAD, VARIABLE, Died, ExecutorWorkers, Work, WorkersError
from cylinder_friction.extras import explained
from cylinder_friction.import_graph import PACKAGES, SOURCE

with explained():
    from distributed import Client, KilledWorker, Security, Worker, get_worker
    from threadpoolctl import threadpool_info, threadpool_limits

LIBRARIES = ("numpy", "scipy", "pandas", "pyarrow", "numba", "torch", "scikit-learn", "onnx", "optuna")
"""Their versions may change the last bits of a result."""
MACHINE = ("processor", "BLAS")
"""May differ between this machine and the workers, but not among the workers."""
CONNECT_S = 30.0
PATIENCE_S = 60.0
"""So long a cluster may be without any worker."""
AT_ONCE = 2000


class Cluster(ExecutorWorkers):
    """The workers of a Dask scheduler, which need to see the same files under the same paths.

    Dask repeats a piece whose worker is lost, and gives it up when several workers died of it.

    ``address`` is that of the scheduler, or the file that it wrote.
    """

    at_once, lost = AT_ONCE, (KilledWorker, CancelledError)

    def __init__(self, address: str) -> None:
        self.address = address
        self._client: Client | None = None

    def __exit__(self, error: type[BaseException] | None, *_: object) -> None:
        if self._client is not None:  # what waits is dropped, and what runs does no harm
            self._client.close()
            self._client = None

    def executor(self) -> Executor:
        """Return the scheduler's executor, once there are workers that are alike.

        Raises:
            WorkersError: There is no scheduler or no worker, or workers differ from each other or from this code.
        """
        if self._client is None:
            self._client = self._connected()
            self._setting = Setting(Path.cwd(), common_environment(environment(), self._environments()))
            self._executor = _ClientExecutor(self._client)
        return self._executor

    def prepared(self, piece: Work) -> Work:
        return partial(self._setting.do, piece)

    def died(self, error: Exception, _executor: Executor) -> Died:
        if not isinstance(error, KilledWorker):
            raise WorkersError(f"the scheduler at {self.address} is gone; start it, then repeat the command") from None
        last = error.last_worker
        return Died(
            f"{error.allowed_failures + 1} workers died of it, the last one {last.address} with a memory limit of "
            f"{last.memory_limit / 2**30:.3g} GiB; it may have run out of memory"
        )

    def look_after(self) -> None:
        assert self._client is not None
        try:
            self._client.wait_for_workers(1, timeout=PATIENCE_S)
        except TimeoutError:
            raise WorkersError(
                f"the scheduler at {self.address} has had no worker for {PATIENCE_S:.0f} s; start workers with "
                "`dask worker --nthreads 1` and the scheduler's address, then repeat the command"
            ) from None

    def _environments(self) -> dict[str, dict[str, str]]:
        """Return the environments of the workers, by their addresses, but for those that die as they are asked."""
        found: dict[str, Any] = {}
        while not found:
            self.look_after()
            assert self._client is not None
            asked = self._client.run(_environment_of, on_error="return")
            found = {address: each for address, each in asked.items() if not isinstance(each, OSError)}
        for each in found.values():
            if isinstance(each, ModuleNotFoundError):
                raise WorkersError(
                    f"a worker of {self.address} cannot import {each.name}; install the same version of "
                    "cylinder-friction there as here, with what it needs"
                )
            if isinstance(each, Exception):
                raise each
        return found

    def _connected(self) -> Client:
        file = Path(self.address)
        where = {"scheduler_file" if file.is_file() else "address": self.address}
        if "tls://" in (file.read_text(encoding="utf-8") if file.is_file() else self.address):
            self._refuse_without_certificates()
        try:
            # Results come by way of the scheduler, which knows which workers have died.
            return Client(**where, timeout=CONNECT_S, set_as_default=False, direct_to_workers=False)
        except OSError:  # a time-out among them
            raise WorkersError(
                f"{VARIABLE} is {self.address}, where no Dask scheduler responds within {CONNECT_S:.0f} s; start one "
                f"with `dask scheduler`, or unset {VARIABLE}"
            ) from None

    def _refuse_without_certificates(self) -> None:
        try:
            found, problem = Security().get_connection_args("client").get("ssl_context"), ""
        except OSError as error:
            found, problem = None, f" ({error})"
        if found is None:
            raise WorkersError(
                f"{VARIABLE} is {self.address}, whose scheduler wants a certificate, and there is none{problem}; set "
                "DASK_DISTRIBUTED__COMM__TLS__CA_FILE, DASK_DISTRIBUTED__COMM__TLS__CLIENT__CERT and "
                "DASK_DISTRIBUTED__COMM__TLS__CLIENT__KEY to their files"
            )


class _ClientExecutor(Executor):
    """Gives pieces to a client's scheduler.

    ``Client.get_executor`` takes a result whose worker dies as it arrives for an exception, and fails to unpack it.
    """

    def __init__(self, client: Client) -> None:
        self._client = client

    def submit(self, piece: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        finished: Future[Any] = Future()
        given = self._client.submit(piece, *args, pure=False, **kwargs)
        assert self._client.loop is not None
        self._client.loop.add_callback(self._hand_over, given, finished)
        return finished

    async def _hand_over(self, given: Any, finished: Future[Any]) -> None:
        try:
            finished.set_result(await self._client.gather(given, asynchronous=True))
        except Exception as error:
            finished.set_exception(error)


@dataclass(frozen=True)
class Setting:
    """What a worker makes sure of before each piece."""

    folder: Path  # The client's working directory, from which relative paths count
    expected: Mapping[str, str]  # What ``environment`` returns on every worker

    def do(self, piece: Work) -> Any:
        """Return what the piece returns.

        Raises:
            WorkersError: This worker differs from the others, or does not see the client's files.
        """
        refuse_unlike(self.expected, get_worker().address, _environment_of(get_worker()))
        if not self.folder.is_dir():
            raise WorkersError(
                f"worker {get_worker().address} has no folder {self.folder}, in which the command was given; workers "
                "need to see the same files under the same paths"
            )
        os.chdir(self.folder)
        _take_one_thread()
        return piece()


def _environment_of(dask_worker: Worker) -> dict[str, str]:  # Dask fills in an argument of this name
    return environment(dask_worker.state.nthreads)


@cache
def environment(threads: int = 1) -> dict[str, str]:
    """Return what decides the last bits of results in this process: code, libraries, processor, threads of work."""
    return {
        "code": _code(),
        "python": platform.python_version(),
        **{name: _version(name) for name in LIBRARIES},
        "processor": f"{llvm.get_host_cpu_name()} {_short(llvm.get_host_cpu_features().flatten().encode())}",
        "BLAS": ", ".join(sorted({each["architecture"] for each in threadpool_info() if "architecture" in each})),
        "threads": str(threads),
    }


def common_environment(own: Mapping[str, str], workers: Mapping[str, Mapping[str, str]]) -> dict[str, str]:
    """Return the environment of the workers, by their addresses.

    Code and libraries must be those of this process; processors must be alike among the workers, and where they are
    not like this one's, that is noted.

    Raises:
        WorkersError: A worker differs.
    """
    first = workers[min(workers)]
    expected = {**own, **{name: first[name] for name in MACHINE}}
    for address, found in sorted(workers.items()):
        refuse_unlike(expected, address, found)
    unlike = [f"{name} {expected[name]} (here {own[name]})" for name in MACHINE if expected[name] != own[name]]
    if unlike:
        tqdm.write(
            f"note: all workers have {', '.join(unlike)}; the last bits of results may differ from those made here"
        )
    return expected


def refuse_unlike(expected: Mapping[str, str], address: str, found: Mapping[str, str]) -> None:
    """Raise ``WorkersError`` if a worker's environment is not the expected one."""
    unlike = [f"{name} {found[name]} (expected {value})" for name, value in expected.items() if found[name] != value]
    if unlike:
        raise WorkersError(
            f"worker {address} has {', '.join(unlike)}; results would not be equal bit for bit; start all workers "
            "with `--nthreads 1`, from the environment of this command and on machines of one type"
        )


@cache
def _take_one_thread() -> None:
    """Have every library take one thread, and no worker workers of its own; a nanny does some of it."""
    os.environ.pop(VARIABLE, None)
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    threadpool_limits(1)
    numba.config.reload_config()  # it does so when it compiles, and then refuses another number than it has started
    numba.set_num_threads(1)


def _code() -> str:
    paths = sorted(path for package in PACKAGES for path in (SOURCE / package).rglob("*.py"))
    return _short(b"\0".join(part for path in paths for part in (bytes(path.relative_to(SOURCE)), path.read_bytes())))


def _short(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:12]


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"
