"""The files of a saved estimator: regular files of limited size, with the hashes that ``save`` wrote."""

import hashlib
import json
import os
import stat
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cylinder_friction.files.whole_files import json_hash, write_json

DESCRIPTION_FILE = "estimator.json"
LARGEST_FILE = 64 * 2**20  # Largest file of a model [bytes]
FILES, CONTENT_HASH = "files", "sha256"
"""Entries of the description: the hashes of the other files, and the hash of the description without this entry."""


class SavedModelError(ValueError):
    """A folder does not hold what ``save`` wrote."""


def write_description(folder: Path, content: dict[str, Any], files: Sequence[str]) -> None:
    """Write an estimator's description with the hashes of its other ``files``, which are already in ``folder``."""
    content = {**content, FILES: {name: hashlib.sha256(read_plain_file(folder / name)).hexdigest() for name in files}}
    write_json(folder / DESCRIPTION_FILE, {**content, CONTENT_HASH: json_hash(content)})


def read_description(folder: Path) -> dict[str, Any]:
    """Read the description of a saved estimator and check all hashes that it states.

    A description of an earlier version states no hashes.

    Raises:
        FileNotFoundError: The folder holds no description.
        SavedModelError: The description is damaged, or a file was changed after ``save``.
    """
    path = folder / DESCRIPTION_FILE
    if not path.exists():
        raise FileNotFoundError(f"{folder}: holds no {DESCRIPTION_FILE}; expected a folder that `save` wrote")
    stored = read_plain_file(path)
    try:
        content = json.loads(stored, parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as error:
        raise SavedModelError(f"{path}: is no JSON that `save` wrote ({error}); save the model again") from None
    if not isinstance(content, dict):
        raise SavedModelError(f"{path}: holds a {type(content).__name__}, but expected what `save` wrote")
    stated = content.pop(CONTENT_HASH, None)
    if stated is not None and stated != json_hash(content):
        raise SavedModelError(f"{path}: was changed after `save` wrote it; save the model again, or take a whole copy")
    files = content.pop(FILES, {})
    for name, digest in files.items() if isinstance(files, dict) else ():
        if Path(name).name != name or hashlib.sha256(read_plain_file(folder / name)).hexdigest() != digest:
            raise SavedModelError(
                f"{folder / name}: is not the file that `save` wrote; save the model again, or take a whole copy"
            )
    return content


def read_plain_file(path: Path) -> bytes:
    """Read a regular file; refuse a pipe or device without waiting for it.

    Raises:
        SavedModelError: It is not there, no regular file, or larger than ``LARGEST_FILE``.
    """
    try:
        file = open(path, "rb", buffering=0, opener=_open_without_waiting)  # noqa: SIM115 - closed below
    except OSError as error:
        raise SavedModelError(f"{path}: cannot be read ({error.strerror}); take a whole copy of the model") from None
    with file:
        status = os.fstat(file.fileno())
        if not stat.S_ISREG(status.st_mode) or status.st_size > LARGEST_FILE:
            what = f"has {status.st_size} bytes" if stat.S_ISREG(status.st_mode) else "is no regular file"
            raise SavedModelError(f"{path}: {what}, but expected a file of at most {LARGEST_FILE} bytes")
        return file.read()


def _open_without_waiting(path: str, flags: int) -> int:
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))


def _refuse_constant(name: str) -> Any:
    raise ValueError(f"{name} is no finite number")
