"""DVC's hashes of data: as stated in ``dvc.lock``, and of files on disk."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from cylinder_friction.recordings.recording import RecordingError

LOCK_FILE = "dvc.lock"


def locked_hashes(text: str) -> dict[str, str]:
    """Read ``{path: md5}`` of every output and dependency in a ``dvc.lock``; outputs take precedence.

    Raises:
        ValueError: It is not as DVC writes it.
    """
    result: dict[str, str] = {}
    try:
        stages = (yaml.safe_load(text) or {}).get("stages", {})
        for kind in ("deps", "outs"):
            for stage in stages.values():
                result |= {entry["path"].rstrip("/"): entry["md5"] for entry in stage.get(kind, ()) if "md5" in entry}
    except (yaml.YAMLError, AttributeError, KeyError, TypeError) as error:
        raise ValueError(
            f"{LOCK_FILE}: is not as DVC writes it ({type(error).__name__}); `git checkout {LOCK_FILE}` brings it back"
        ) from error
    return result


def hashes_in(root: Path) -> dict[str, str]:
    """Read the ``dvc.lock`` of a folder, see ``locked_hashes``; empty if there is none."""
    path = root / LOCK_FILE
    return locked_hashes(path.read_bytes().decode(errors="replace")) if path.is_file() else {}


def dvc_hash(path: Path) -> str:
    """Hash a file or a folder (``.dir`` at the hash's end) as DVC does; reads every byte."""
    from dvc_data.hashfile.build import build  # DVC: an extra, and slow
    from dvc_data.hashfile.db import HashFileDB
    from dvc_objects.fs.local import LocalFileSystem

    files: Any = LocalFileSystem()
    _, _, found = build(HashFileDB(files, str(path.parent)), str(path), files, "md5", dry_run=True)
    return str(found.hash_info.value)


def known_hash(path: Path, root: Path = Path()) -> str:
    """Look up DVC's hash of a file or folder below ``root``.

    While DVC runs a stage, ``dvc.lock`` states the hash of everything that earlier stages wrote, so nothing is read.
    Otherwise the files are hashed.
    """
    stated = hashes_in(root) if "DVC_STAGE" in os.environ else {}
    return stated.get(path.relative_to(root).as_posix()) or dvc_hash(path)


def data_hashes(folders: Sequence[str]) -> dict[str, str]:
    """Look up the hashes of folders of data in ``dvc.lock``.

    Raises:
        RecordingError: ``dvc.lock`` is not there or does not know one of the folders.
    """
    known, names = hashes_in(Path()), [folder.rstrip("/") for folder in folders]
    if missing := [name for name in names if name not in known]:
        raise RecordingError(
            f"{Path(LOCK_FILE).absolute()}: knows no output or dependency {missing[0]!r}, but has {sorted(known)}; run "
            "the pipeline with `dvc repro`, which writes down the version of the data"
        )
    return {name: known[name] for name in names}
