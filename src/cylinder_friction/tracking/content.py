"""Content hashes: what was logged or registered is recognised by its bytes, not by its name or its time."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path


def hash_of(path: Path) -> str:
    """Return the SHA-256 of a file's bytes, or of a folder's relative names and their files' hashes.

    Python's bytecode caches inside a folder do not count.

    Raises:
        FileNotFoundError: There is neither a file nor a folder of that name.
    """
    if not path.is_dir():
        with path.open("rb", buffering=0) as file:  # in pieces: a recording need not fit into memory
            return hashlib.file_digest(file, "sha256").hexdigest()
    digest = hashlib.sha256()
    for inner in sorted(inner for inner in path.rglob("*") if inner.is_file() and "__pycache__" not in inner.parts):
        digest.update(f"{inner.relative_to(path).as_posix()}\0{hash_of(inner)}\n".encode())
    return digest.hexdigest()
