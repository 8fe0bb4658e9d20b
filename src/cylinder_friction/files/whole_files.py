"""Output that appears whole or not at all, hashes of files and folders, and locks between processes."""

import errno
import hashlib
import json
import os
import shutil
import sys
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import yaml

LARGEST_YAML = 1 << 20
PIECE = 1 << 18  # Bytes hashed at a time
DRAFTS = f".{'[0-9a-f]' * 32}.draft*"
"""Pattern of unfinished files of ``whole_file``; no person gives such a name."""


@contextmanager
def whole_folder(folder: Path) -> Iterator[Path]:
    """Yield a new empty folder that replaces ``folder`` only if the block ends without an error.

    Each has a unique name, so that a worker that outlives an earlier run cannot write into it.
    """
    drafts = folder.with_name(f".{folder.name}.draft")
    shutil.rmtree(drafts, ignore_errors=True)
    draft = drafts / uuid.uuid4().hex
    draft.mkdir(parents=True)
    try:
        yield draft
        if folder.exists():
            shutil.rmtree(folder)
        draft.rename(folder)
    finally:
        shutil.rmtree(drafts, ignore_errors=True)


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Yield the path of a draft to write, which replaces ``path`` only if the block ends without an error.

    Each writer has its own draft, since on a cluster the same work may be done twice.
    """
    if not path.parent.is_dir():
        path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(f".{uuid.uuid4().hex}.draft{path.suffix}")
    try:
        yield draft
        draft.replace(path)
    except BaseException:
        with suppress(OSError):  # an error of a read-only file system would hide the first one
            draft.unlink(missing_ok=True)
        raise


def write_text(path: Path, text: str) -> None:
    """Write a file whole, in UTF-8; see ``write_bytes``."""
    write_bytes(path, text.encode())


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file whole: as a draft beside it, which is then moved over it."""
    with whole_file(path) as draft:
        draft.write_bytes(content)


def write_json(path: Path, content: Any) -> None:
    """Write JSON with sorted keys, so that equal content is equal bytes; NaN is refused (``ValueError``)."""
    write_text(path, json.dumps(content, indent=2, sort_keys=True, allow_nan=False) + "\n")


def read_json(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8"))


def read_yaml(path: Path) -> dict[str, Any]:
    """Read the keys and values of a YAML file that a person wrote; an empty file has none.

    Raises:
        FileNotFoundError: There is no such file.
        ValueError: It is no regular file, too large, no YAML, holds no keys, or contains itself.
    """
    if path.exists() and not (path.is_file() and path.stat().st_size <= LARGEST_YAML):
        raise ValueError(f"{path}: expected a regular file of at most {LARGEST_YAML} bytes")
    text = path.read_text(encoding="utf-8")
    try:
        content = yaml.load(text, yaml.CSafeLoader)  # A tenth of the time of the loader in Python
        json.dumps(content, default=str)  # refuses what contains itself
    except (yaml.YAMLError, ValueError, RecursionError, TypeError) as error:
        problem = " ".join(str(error).split()) or type(error).__name__
        raise ValueError(f"{path}: is no YAML of plain keys and values ({problem})") from None
    if not isinstance(content, dict | None):
        raise ValueError(f"{path}: expected keys and values, but got {str(content)[:80]!r}")
    return content or {}


def json_hash(content: Any) -> str:
    """Hash content as JSON (SHA-256), whatever the order of its keys."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def hash_of(path: Path, ignored: str = "") -> str:
    """Hash a file's bytes, or a folder's relative names and their files' hashes (SHA-256).

    Inside a folder, Python's bytecode caches and the folder's own file named ``ignored`` do not count.

    Raises:
        FileNotFoundError: There is neither a file nor a folder of that name.
    """
    digest = hashlib.sha256()
    if not path.is_dir():
        with path.open("rb", buffering=0) as file:  # in pieces: a recording need not fit into memory
            while piece := file.read(PIECE):
                digest.update(piece)
        return digest.hexdigest()
    names: list[Path] = []
    for folder, inner, files in os.walk(path):
        inner[:] = [each for each in inner if each != "__pycache__"]
        names += [Path(folder, each).relative_to(path) for each in files]
    for name in sorted(names):
        if (path / name).is_file() and name.as_posix() != ignored:
            digest.update(f"{name.as_posix()}\0{hash_of(path / name)}\n".encode())
    return digest.hexdigest()


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
