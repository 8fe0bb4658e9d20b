"""The files of a folder of results: their paths, and how damaged files are handled."""

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from cylinder_friction_monitoring.errors import Refused

Read = TypeVar("Read")
RESULTS = "friction"  # Folder with a folder per cylinder that ``estimate_logs`` writes
UNREADABLE = (ValueError, LookupError, TypeError, AttributeError, OSError, NotImplementedError)


def session_file(name: str) -> str:
    """Return the path of a cylinder's table of sessions."""
    return f"sessions/{name}.parquet"


def state_file(name: str) -> str:
    """Return the path of a cylinder's latest assessment."""
    return f"cylinders/{name}.json"


def pane_file(name: str) -> str:
    """Return the path of a cylinder's pane of the page."""
    return f"panes/{name}.js"


def read_or_name(
    folder: Path, file: str, read: Callable[[Path], Read], absent: Read, anew: str, damaged: list[Refused]
) -> Read:
    """Read a file of an earlier run. A missing or damaged file gives ``absent``; a damaged one is added to ``damaged``.

    ``anew`` states how the run continues without the file.
    """
    if not (folder / file).is_file():
        return absent
    try:
        return read(folder / file)
    except UNREADABLE as error:
        problem = " ".join(f"{type(error).__name__}: {error}".split())
        damaged.append(Refused(file, f"is damaged ({problem}); {anew}"))
        return absent
