"""What data and parameters a model came from: ``dvc.lock``'s hashes, the parameters' hash, and where the data lies."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml
from dvc.exceptions import NotDvcRepoError
from dvc.repo import Repo
from dvc_data.hashfile.build import build
from dvc_data.hashfile.db import HashFileDB
from dvc_data.hashfile.hash_info import HashInfo
from dvc_data.hashfile.tree import Tree
from dvc_objects.errors import ObjectFormatError
from dvc_objects.fs.local import LocalFileSystem

from cylinder_friction.recordings.files import json_hash
from cylinder_friction.tracking.repository import LineageError
from cylinder_friction.wording import in_brief

LOCK_FILE = "dvc.lock"
PARAMS_FILE = "params.yaml"
EVALUATING_SECTIONS = ("lugre", "compare", "register")
"""Sections of the parameters that do not shape the model; all others belong to its origin."""


@dataclass(frozen=True)
class Origin:
    """What a model was made from."""

    data: dict[str, str]  # Folder to DVC's hash of it: the raw recordings first, then what was made of them
    raw: str  # Which of these folders is the raw one
    params: dict[str, Any]  # The parameters that shaped the model

    @property
    def params_sha256(self) -> str:
        return json_hash(self.params)


def origin_of(root: Path, raw: str, processed: Sequence[str]) -> Origin:
    """Return what the workspace's models are made from, from ``dvc.lock`` and ``params.yaml``.

    ``raw`` and ``processed`` are folders of recordings, relative to the repository's root.

    Raises:
        LineageError: ``dvc.lock`` is not there or does not know one of the folders.
    """
    path = root / LOCK_FILE
    if not path.is_file():
        raise LineageError(f"{path}: not there; run the pipeline with `dvc repro`, which writes it")
    known = locked_hashes(path.read_bytes().decode(errors="replace"))
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
    """Return ``{path: md5}`` of every output and dependency in a ``dvc.lock``; outputs have the last word.

    Raises:
        LineageError: It is not as DVC writes it.
    """
    result: dict[str, str] = {}
    try:
        stages = (yaml.safe_load(text) or {}).get("stages", {})
        for kind in ("deps", "outs"):
            for stage in stages.values():
                result |= {entry["path"].rstrip("/"): entry["md5"] for entry in stage.get(kind, ()) if "md5" in entry}
    except (yaml.YAMLError, AttributeError, KeyError, TypeError) as error:
        raise LineageError(
            f"{LOCK_FILE}: is not as DVC writes it ({type(error).__name__}); `git checkout {LOCK_FILE}` brings it back"
        ) from error
    return result


def shaping_params(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return the sections of the parameters that shape a model."""
    return {section: values for section, values in content.items() if section not in EVALUATING_SECTIONS}


def dvc_hash(path: Path) -> str:
    """Return the hash that DVC gives a file or a folder (``.dir`` at its end), every byte read."""
    files = LocalFileSystem()
    _, _, found = build(HashFileDB(files, str(path.parent)), str(path), files, "md5", dry_run=True)
    return str(found.hash_info.value)


def where_data_lies(root: Path, path: str, md5: str) -> tuple[bool, str]:
    """Return whether data of this very content lies anywhere, and where, or why not, in words.

    On disk and in DVC's cache every byte is read and hashed; a remote, which keeps files by their hash, is asked
    whether it has them.
    """
    place = Path(os.path.abspath(root / path))  # noqa: PTH100 - DVC makes links
    if not place.is_relative_to(root.absolute()):
        return False, f"{path} lies outside the project, whose data alone is looked at"
    if place.exists() and dvc_hash(place) == md5:
        return True, f"on disk at {path}"
    nowhere = ["neither on disk nor whole in DVC's cache, nor on a remote"]
    try:
        repo = Repo(str(root))
    except NotDvcRepoError:
        return False, f"{nowhere[0]}; this is no DVC repository"
    cache = repo.cache.local
    if _whole_in_cache(cache, md5):
        return True, f"in DVC's cache at {Path(cache.path)}"
    for name in repo.config["remote"]:
        try:
            if _all_on_remote(repo.cloud.get_remote_odb(name), md5):
                return True, f"on DVC's remote {name!r}"
        except Exception as error:  # each kind of store has its own: no library for it, no key, no connection
            nowhere.append(f"DVC's remote {name!r} cannot be read ({in_brief(error)})")
    return False, "; ".join([*nowhere, "run `dvc pull`"])


def _files(store: HashFileDB, md5: str) -> set[str] | None:
    """Return the hash of every file of the data; of a folder the list is read and hashed, None if it is not whole."""
    if not md5.endswith(".dir"):
        return {md5}
    try:
        tree = Tree.load(store, HashInfo("md5", md5))
    except (FileNotFoundError, ObjectFormatError):
        return None
    tree.digest()
    return {file.value for _, _, file in tree} if tree.hash_info.value == md5 else None


def _all_on_remote(remote: HashFileDB, md5: str) -> bool:
    try:
        remote.fs.info(remote.oid_to_path(md5))  # unlike exists() it raises if the remote does not let us in
    except FileNotFoundError:
        return False
    files = _files(remote, md5)
    return files is not None and files <= set(remote.oids_exist(files))


def _whole_in_cache(cache: HashFileDB, md5: str) -> bool:
    files = _files(cache, md5)
    paths = {file: Path(cache.oid_to_path(file)) for file in files or ()}
    return files is not None and all(path.is_file() and dvc_hash(path) == file for file, path in paths.items())
