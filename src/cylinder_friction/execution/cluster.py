"""Work on a Dask cluster: workers of one thread each, with equal code, libraries and processors."""

from __future__ import annotations

import hashlib
import os
import platform
from collections.abc import Mapping
from concurrent.futures import CancelledError, Future
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
from tqdm import tqdm

from cylinder_friction.execution.workers import VARIABLE, ExecutorWorkers, LostPiece, Work, WorkersError
from cylinder_friction.extras import explained
from cylinder_friction.import_graph import PACKAGES, SOURCE

with explained():
    from distributed import Client, KilledWorker, Security, Worker
    from distributed.scheduler import NoWorkerError
    from threadpoolctl import threadpool_info

LIBRARIES = ("numpy", "scipy", "pandas", "pyarrow", "numba", "torch", "scikit-learn", "onnx", "optuna")
"""Their versions may change the last bits of a result."""
MACHINE = ("processor", "BLAS")
"""Parts of the environment that may differ between this machine and the workers, but not among the workers."""
CONNECT_S = 30.0
PATIENCE_S = 60.0
"""Time limit for the first worker [s]."""


class Cluster(ExecutorWorkers):
    """The workers of a Dask scheduler, which must see the same files under the same paths.

    Equal bits need equal code, libraries and processors, and one thread per worker. These are compared once, when the
    ``with`` statement begins. Dask repeats a piece whose worker is lost, and gives it up after several workers died.

    Args:
        address: Address of the scheduler, or the file that it wrote.

    Raises:
        WorkersError: On entering: there is no scheduler or no worker, or workers differ from each other or from this
            process.
    """

    at_once = 2000

    def __init__(self, address: str) -> None:
        self.address = address

    def __enter__(self) -> Cluster:
        self._client = self._connected()
        try:
            common_environment(environment(), self._environments())
        except BaseException:
            self._client.close()
            raise
        return self

    def __exit__(self, error: type[BaseException] | None, *_: object) -> None:
        self._client.close()  # waiting pieces are dropped; running ones do no harm

    def submit(self, piece: Work) -> Future[Any]:
        """Hand out a piece, as ``Client.get_executor()`` does.

        Dask's executor reads a piece's state after its result has come. If the worker dies in between, the executor
        takes the result for an exception, and fails to unpack it.
        """
        finished: Future[Any] = Future()
        given = self._client.submit(in_folder, Path.cwd(), piece, pure=False)
        assert self._client.loop is not None
        self._client.loop.add_callback(self._hand_over, given, finished)
        return finished

    async def _hand_over(self, given: Any, finished: Future[Any]) -> None:
        try:
            finished.set_result(await self._client.gather(given, asynchronous=True))
        except Exception as error:
            finished.set_exception(error)

    def explain_loss(self, error: Exception) -> LostPiece | None:
        if isinstance(error, CancelledError):
            raise WorkersError(f"the scheduler at {self.address} is gone; start it, then repeat the command") from None
        if isinstance(error, NoWorkerError):
            raise WorkersError(f"the scheduler at {self.address} gave up waiting for workers: {error}") from None
        if not isinstance(error, KilledWorker):
            return None
        last = error.last_worker
        return LostPiece(
            f"{error.allowed_failures + 1} workers died of it, the last one {last.address} with a memory limit of "
            f"{last.memory_limit / 2**30:.3g} GiB; it may have run out of memory"
        )

    def _environments(self) -> dict[str, dict[str, str]]:
        """Collect the workers' environments by address, without those of workers that die when asked."""
        found: dict[str, Any] = {}
        while not found:
            try:
                self._client.wait_for_workers(1, timeout=PATIENCE_S)
            except TimeoutError:
                raise WorkersError(
                    f"the scheduler at {self.address} has had no worker for {PATIENCE_S:.0f} s; start workers with "
                    "`dask worker --nthreads 1` and the scheduler's address, then repeat the command"
                ) from None
            asked = self._client.run(_environment_of, Path.cwd(), on_error="return")
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
            # Results come through the scheduler, which knows the workers that died.
            return Client(**where, timeout=CONNECT_S, set_as_default=False, direct_to_workers=False)
        except OSError:  # a time-out among them
            raise WorkersError(
                f"{VARIABLE} is {self.address}, but no Dask scheduler responds there within {CONNECT_S:.0f} s; start "
                f"one with `dask scheduler`, or unset {VARIABLE}"
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


def in_folder(folder: Path, piece: Work) -> Any:
    """Do a piece in the command's folder, to which relative paths refer."""
    os.chdir(folder)
    return piece()


def _environment_of(folder: Path, dask_worker: Worker) -> dict[str, str]:  # Dask fills in an argument of this name
    libraries = max((each["num_threads"] for each in threadpool_info()), default=1)
    found = environment(dask_worker.state.nthreads, libraries)
    if not folder.is_dir():
        raise WorkersError(
            f"worker {dask_worker.address} has no folder {folder}, in which the command was given; workers need to see "
            "the same files under the same paths"
        )
    return found


def environment(threads: int = 1, library_threads: int = 1) -> dict[str, str]:
    """Collect what decides the last bits of results in this process: code, libraries, processor, threads."""
    return {
        "code": _code(),
        "python": platform.python_version(),
        **{name: _version(name) for name in LIBRARIES},
        "processor": f"{llvm.get_host_cpu_name()} {_short(llvm.get_host_cpu_features().flatten().encode())}",
        "BLAS": ", ".join(sorted({each["architecture"] for each in threadpool_info() if "architecture" in each})),
        "threads": str(threads),
        "threads of libraries": str(library_threads),
    }


def common_environment(own: Mapping[str, str], workers: Mapping[str, Mapping[str, str]]) -> None:
    """Refuse workers, given by their addresses, whose results would not be equal bit for bit.

    Code and libraries must equal those of this process, and processors must be alike among the workers. If processors
    differ from this machine's, a note is written.

    Raises:
        WorkersError: A worker differs.
    """
    first = workers[min(workers)]
    expected = {**own, **{name: first[name] for name in MACHINE}}
    for address, found in sorted(workers.items()):
        unlike = [f"{name} {found[name]} (expected {each})" for name, each in expected.items() if found[name] != each]
        if unlike:
            raise WorkersError(
                f"worker {address} has {', '.join(unlike)}; results would not be equal bit for bit; start all workers "
                "with `--nthreads 1`, from the environment of this command and on machines of one type"
            )
    unlike = [f"{name} {expected[name]} (here {own[name]})" for name in MACHINE if expected[name] != own[name]]
    if unlike:
        tqdm.write(
            f"note: all workers have {', '.join(unlike)}; the last bits of results may differ from those made here"
        )


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
