"""Content hashes: what was logged or registered is recognised by its bytes, not by its name or its time."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path


def hash_of(path: Path) -> str:
    """Returns the SHA-256 of a file's bytes, or of a folder's relative names and their files' hashes.

    Python's bytecode caches inside a folder do not count.

    Raises:
        FileNotFoundError: There is neither a file nor a folder of that name.
    """
    if not path.is_dir():
        return hashlib.sha256(path.read_bytes()).hexdigest()
    digest = hashlib.sha256()
    for file in sorted(file for file in path.rglob("*") if file.is_file() and "__pycache__" not in file.parts):
        digest.update(f"{file.relative_to(path).as_posix()}\0{hash_of(file)}\n".encode())
    return digest.hexdigest()
