"""Whether a version of the data still exists: in its place, or in DVC's cache."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from cylinder_friction.tracking.versions import dvc_hash, file_md5, folder_hash


def where_data_lies(root: Path, path: str, md5: str) -> str | None:
    """Return where data of this very content lies, every byte of it read and hashed; None where it lies nowhere.

    Args:
        root: The repository's root.
        path: File or folder, relative to it.
        md5: DVC's hash of it.
    """
    place = root / path
    if place.exists() and dvc_hash(place) == md5:
        return f"on disk at {path}"
    cache = _cache(root)
    if cache is not None and _whole_in_cache(cache, md5):
        return f"in DVC's cache at {cache}"
    return None


def _whole_in_cache(cache: Path, md5: str) -> bool:
    entry = _entry(cache, md5)
    if not entry.is_file():
        return False
    if not md5.endswith(".dir"):
        return file_md5(entry) == md5
    try:
        listing = json.loads(entry.read_text(encoding="utf-8"))
        files = [file["md5"] for file in listing]
    except (ValueError, KeyError, TypeError):
        return False
    return folder_hash(listing) == md5 and all(
        _entry(cache, file).is_file() and file_md5(_entry(cache, file)) == file for file in files
    )


def _entry(cache: Path, md5: str) -> Path:
    return cache / "files" / "md5" / md5[:2] / md5[2:]


def _cache(root: Path) -> Path | None:
    default = root / ".dvc" / "cache"
    if (default / "files").is_dir():
        return default
    asked = subprocess.run(
        [sys.executable, "-m", "dvc", "cache", "dir"], cwd=root, capture_output=True, text=True, check=False
    )
    return Path(asked.stdout.strip()) if asked.returncode == 0 and asked.stdout.strip() else None
