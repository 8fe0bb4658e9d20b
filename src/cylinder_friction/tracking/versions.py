"""What data and parameters a model came from: ``dvc.lock``'s hashes, DVC's way of hashing, and the parameters' hash."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Self

import yaml

from cylinder_friction.tracking.errors import LineageError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

LOCK_FILE = "dvc.lock"
PARAMS_FILE = "params.yaml"
JUDGING_SECTIONS = ("lugre", "compare", "register")
"""Sections of the parameters that judge a model but do not shape it; all others belong to where it came from."""


@dataclass(frozen=True)
class Origin:
    """What a model was made from.

    Attributes:
        data: Folder to DVC's hash of it: the raw recordings first, then what was made of them.
        raw: Which of these folders is the raw one.
        params: The parameters that shaped the model.
    """

    data: dict[str, str]
    raw: str
    params: dict[str, Any]

    @property
    def params_sha256(self) -> str:
        return params_hash(self.params)

    def tags(self) -> dict[str, str]:
        """Return the tags of a registered version: one hash each."""
        processed = {
            f"data_{path.removeprefix('data/').replace('/', '_')}_md5": md5
            for path, md5 in self.data.items()
            if path != self.raw
        }
        raw = {"data_raw_path": self.raw, "data_raw_md5": self.data[self.raw]}
        return {**raw, **processed, "params_sha256": self.params_sha256}

    def to_dict(self) -> dict[str, Any]:
        return asdict(self)

    @classmethod
    def from_dict(cls, content: dict[str, Any]) -> Self:
        return cls(**content)


def origin_of(root: Path, raw: str, processed: Sequence[str]) -> Origin:
    """Return what the workspace's models are made from, as ``dvc.lock`` and ``params.yaml`` say.

    Args:
        root: The repository's root.
        raw: Folder of raw recordings, relative to it.
        processed: Folders of processed recordings.

    Raises:
        LineageError: ``dvc.lock`` is not there or does not know one of the folders.
    """
    path = root / LOCK_FILE
    if not path.is_file():
        raise LineageError(f"{path}: not there; run the pipeline with `dvc repro`, which writes it")
    known = locked_hashes(path.read_text(encoding="utf-8"))
    folders = [folder.rstrip("/") for folder in (raw, *processed)]
    for folder in folders:
        if folder not in known:
            raise LineageError(
                f"{path}: knows no output or dependency {folder!r}, but has {sorted(known)}; run `dvc repro` so that "
                "the data's version is written down"
            )
    params = shaping_params(yaml.safe_load((root / PARAMS_FILE).read_text(encoding="utf-8")))
    return Origin({folder: known[folder] for folder in folders}, folders[0], params)


def locked_hashes(text: str) -> dict[str, str]:
    """Return ``{path: md5}`` of every output and dependency in a ``dvc.lock``; outputs have the last word."""
    stages = (yaml.safe_load(text) or {}).get("stages", {})
    result: dict[str, str] = {}
    for kind in ("deps", "outs"):
        for stage in stages.values():
            result |= {entry["path"].rstrip("/"): entry["md5"] for entry in stage.get(kind, ()) if "md5" in entry}
    return result


def shaping_params(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return the sections of the parameters that shape a model."""
    return {section: values for section, values in content.items() if section not in JUDGING_SECTIONS}


def params_hash(params: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(params, sort_keys=True).encode()).hexdigest()


def dvc_hash(path: Path) -> str:
    """Return the hash that DVC gives a file or a folder (``.dir`` at its end).

    A folder's is the MD5 of the JSON list of its files' MD5 and relative paths, sorted by path.
    """
    if not path.is_dir():
        return file_md5(path)
    files = sorted(file.relative_to(path) for file in path.rglob("*") if file.is_file())
    return folder_hash([{"md5": file_md5(path / file), "relpath": file.as_posix()} for file in files])


def folder_hash(entries: Sequence[Mapping[str, str]]) -> str:
    """Return the hash that DVC gives a folder with these files."""
    ordered = sorted(entries, key=lambda entry: entry["relpath"])
    listing = json.dumps([{"md5": entry["md5"], "relpath": entry["relpath"]} for entry in ordered], sort_keys=True)
    return f"{hashlib.md5(listing.encode(), usedforsecurity=False).hexdigest()}.dir"


def file_md5(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, lambda: hashlib.md5(usedforsecurity=False)).hexdigest()
