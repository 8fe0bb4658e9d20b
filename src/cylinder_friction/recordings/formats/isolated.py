"""Read binary files in an isolated process, because a damaged file can crash or hang the C library that reads it."""

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing.connection import wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

from cylinder_friction.recordings.formats.format import Format, LoggedTable, guarded, open_source
from cylinder_friction.recordings.recording import RecordingError

if sys.platform != "win32":
    import resource

LIMIT_S, LIMIT_PER_BYTE_S = 60.0, 1.0 / 2e6  # Time limit for an empty file [s], and additional time per byte [s]
LIMIT_BYTES, LIMIT_BYTES_PER_BYTE = 4 << 30, 50
"""Memory limit for an empty file [bytes], and additional bytes per byte of the file."""

_LOCK = threading.Lock()
_READERS: dict[int, tuple[ProcessPoolExecutor, BaseProcess]] = {}
"""The reading process and its pool, by the id of the process that started them; a fork starts its own."""


def _reader() -> ProcessPoolExecutor:
    """Start the process for the first file, and restart it if it has died."""
    pool, process = _READERS.get(os.getpid(), (None, None))
    # is_alive may not notice that another thread reaped it
    if pool is None or process is None or wait([process.sentinel], 0):
        main = sys.modules["__main__"].__dict__
        hidden: dict[str, Any] = {name: main.pop(name) for name in ("__file__", "__spec__") if name in main}
        main["__spec__"] = None
        try:  # otherwise a script without a main guard would run again in the process
            pool = ProcessPoolExecutor(1, multiprocessing.get_context("spawn"), _begin)
            pid = pool.submit(os.getpid).result()
        finally:
            main |= hidden
        _READERS[os.getpid()] = pool, next(child for child in multiprocessing.active_children() if child.pid == pid)
    return pool


def read_isolated(path: Path, of: Format, read: Callable[..., list[LoggedTable]]) -> list[LoggedTable]:
    """Read a file's tables by its format's reader; in a daemon, which may not start processes, in this process."""
    size, path = path.stat().st_size, path.absolute()  # the process stays in the folder where it was started
    limit_s, limit_bytes = LIMIT_S + LIMIT_PER_BYTE_S * size, LIMIT_BYTES + LIMIT_BYTES_PER_BYTE * size
    if multiprocessing.current_process().daemon:
        return _read(read, of.what, path, None)
    with _LOCK:
        try:
            return _reader().submit(_read, read, of.what, path, limit_bytes).result(limit_s)
        except BrokenProcessPool:
            what = f"crashed {of.crashes}"
        except TimeoutError:
            what = f"took longer than {limit_s:.0f} s"
        except RecordingError:
            raise
        except BaseException:
            _end()
            raise
        _end()
    raise RecordingError(f"reading it {what}; the file is damaged; copy it again, or export it anew")


def _end() -> None:
    if reader := _READERS.pop(os.getpid(), None):
        reader[1].kill()


def _begin() -> None:
    """Prepare the process: leave Ctrl-C to its parent, silence its libraries, and end with its parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    parent = multiprocessing.parent_process()
    assert parent is not None

    def end_with_parent() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=end_with_parent, daemon=True).start()


def _read(read: Callable[..., list[LoggedTable]], what: str, path: Path, limit_bytes: int | None) -> list[LoggedTable]:
    if sys.platform != "win32" and limit_bytes is not None:
        _, most = resource.getrlimit(resource.RLIMIT_DATA)
        limit_bytes = limit_bytes if most == resource.RLIM_INFINITY else min(limit_bytes, most)
        resource.setrlimit(resource.RLIMIT_DATA, (limit_bytes, most))
    with guarded(what):
        return read(open_source(path))
