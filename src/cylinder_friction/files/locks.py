"""Locks between processes of one machine: a process holds a file until it releases it or ends in any way."""

import errno
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def locked(path: Path, *, wait: bool = True) -> Iterator[bool]:
    """Hold the lock of a file; yield whether it is held.

    Args:
        path: The file; it and its folder are made if missing. The file stays afterwards.
        wait: Whether to wait until another process has released it; otherwise yield False at once.
    """
    while True:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("a") as file:
            held = _hold(file.fileno(), wait)
            if held and not _is(path, file.fileno()):
                continue  # the previous holder removed it
            yield held
            return


def _is(path: Path, file: int) -> bool:
    try:
        return os.path.samestat(path.stat(), os.fstat(file))
    except FileNotFoundError:
        return False


def _hold(file: int, wait: bool) -> bool:
    """Lock an open file; the lock ends with the process, even if it is killed."""
    if sys.platform != "win32":
        import fcntl

        try:
            fcntl.flock(file, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        except BlockingIOError:
            return False
        return True
    import msvcrt

    while True:
        try:
            msvcrt.locking(file, msvcrt.LK_LOCK if wait else msvcrt.LK_NBLCK, 1)
        except OSError as error:
            if not wait:
                return False
            if error.errno != errno.EDEADLK:  # raised after ten seconds of trying
                raise
        else:
            return True
