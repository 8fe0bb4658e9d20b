"""The process in which binary files are read: a library that crashes or hangs over damage takes nothing else along."""

import faulthandler
import os
import signal
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

from cylinder_friction.recordings.formats.arrow_pipe import read_message, write_message, write_tables
from cylinder_friction.recordings.formats.excel import read_excel
from cylinder_friction.recordings.formats.hdf5 import read_hdf5
from cylinder_friction.recordings.formats.libraries import guarded
from cylinder_friction.recordings.formats.logged_table import LoggedTable
from cylinder_friction.recordings.formats.matlab import read_matlab, read_matlab73
from cylinder_friction.recordings.formats.mdf import read_mdf
from cylinder_friction.recordings.formats.source import open_source
from cylinder_friction.recordings.formats.tdms import read_tdms
from cylinder_friction.recordings.recording import RecordingError

if sys.platform != "win32":
    import resource


_READERS = {
    "excel": (read_excel, "an Excel workbook"),
    "hdf5": (read_hdf5, "an HDF5 file"),
    "matlab": (read_matlab, "a MATLAB file"),
    "matlab73": (read_matlab73, "a MATLAB file"),
    "mdf": (read_mdf, "an MDF file"),
    "tdms": (read_tdms, "a TDMS file"),
}


def serve() -> None:
    """Read the files requested on the standard input until it ends, which it does with the process at its other end."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with suppress(OSError):
        # Where damage makes a library ask for all memory, Linux is to end this process and no other.
        Path("/proc/self/oom_score_adj").write_text("1000", encoding="ascii")
    replies = os.fdopen(os.dup(1), "wb")
    nowhere = os.open(os.devnull, os.O_WRONLY)
    with Path(os.devnull).open("w", encoding="utf-8") as unseen, replies:
        write_message(replies, "ready")
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
        with suppress(EOFError, BrokenPipeError):
            while True:
                request = read_message(sys.stdin.buffer)
                _limit_memory(request["limit_bytes"])
                # A thread of C ends the process in time, also from within a library that never returns to Python.
                faulthandler.dump_traceback_later(request["limit_s"], exit=True, file=unseen)
                tables, refusal = _read(request)
                faulthandler.cancel_dump_traceback_later()
                write_message(replies, refusal)
                if refusal is None:
                    write_tables(replies, tables)


def _limit_memory(limit_bytes: int) -> None:
    """Let larger allocations fail, which the libraries report as any other damage; not on Windows."""
    if sys.platform != "win32":
        _, most = resource.getrlimit(resource.RLIMIT_DATA)
        limit_bytes = limit_bytes if most == resource.RLIM_INFINITY else min(limit_bytes, most)
        resource.setrlimit(resource.RLIMIT_DATA, (limit_bytes, most))


def _read(request: dict[str, Any]) -> tuple[list[LoggedTable], str | None]:
    """Return the tables, or why there are none."""
    read, in_words = _READERS[request["kind"]]
    try:
        with guarded(in_words):
            return read(open_source(Path(request["path"])), request["wanted"]), None
    except RecordingError as error:
        return [], str(error)
