"""A log of one JSON object per line: several processes may write the same file, which is rotated by size."""

import json
import logging
import os
import stat
import time
from pathlib import Path
from typing import Any

_log = logging.getLogger(__name__)


class JsonLog:
    """Appends lines to a file, and follows it when it is rotated, by ``rotate`` or by another program."""

    def __init__(self, path: Path, looks_every_s: float = 1.0) -> None:
        """Open the log; raises ``OSError`` where it cannot be written. Now and then it looks whether it was moved."""
        self._path, self._looks_every_s = path, looks_every_s
        self._look_at_s = 0.0
        self._file = _opened(path)
        self._problem = ""

    def write(self, entry: dict[str, Any]) -> None:
        """Append one line, in one step: lines of several workers do not mix. A full disk fails nobody."""
        try:
            if self._was_moved():
                opened = _opened(self._path)
                os.close(self._file)
                self._file = opened
            os.write(self._file, json.dumps(entry, separators=(",", ":")).encode() + b"\n")
            self._problem = ""
        except OSError as error:
            if str(error) != self._problem:  # once, not with every line
                _log.error("%s: nothing is logged (%s)", self._path, error)
            self._problem = str(error)

    def _was_moved(self) -> bool:
        if (now_s := time.monotonic()) < self._look_at_s:
            return False
        self._look_at_s = now_s + self._looks_every_s
        try:
            there = self._path.stat()
        except FileNotFoundError:
            return True
        return not os.path.samestat(there, os.fstat(self._file))


def rotate(path: Path, max_bytes: int, files: int) -> None:
    """Move a log beyond ``max_bytes`` to ``<path>.1``, and older ones on; keep ``files`` of them."""
    try:
        found = path.stat()
        if found.st_size <= max_bytes or not stat.S_ISREG(found.st_mode):
            return
        for number in range(files, 0, -1):
            older = _numbered(path, number - 1)
            if older.exists():
                older.replace(_numbered(path, number))
    except FileNotFoundError:  # no worker has opened it yet
        pass
    except OSError as error:
        _log.error("%s: cannot be rotated (%s)", path, error)


def _numbered(path: Path, number: int) -> Path:
    return path.with_name(f"{path.name}.{number}") if number else path


def _opened(path: Path) -> int:
    return os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o640)
