"""The way back: from a registered model to its run, its commit, its data and its parameters, each link checked."""

import json
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import yaml
from mlflow.exceptions import MlflowException

from cylinder_friction.dvc_hashes import LOCK_FILE, locked_hashes
from cylinder_friction.files.whole_files import hash_of, json_hash
from cylinder_friction.tracking.model_folder import download_model, version_of
from cylinder_friction.tracking.model_version import FILES, REASON, WRITTEN_ON_LOADING
from cylinder_friction.tracking.repository import LineageError, TrackingError, asked_git, repository_root
from cylinder_friction.tracking.store import Store, open_store
from cylinder_friction.wording import printable

PARAMS_FILE = "params.yaml"
EVALUATING_SECTIONS = ("recipe", "lugre", "compare", "register")
"""Sections of the parameters that do not shape the model; all others belong to its origin."""


def shaping_params(content: Mapping[str, Any]) -> dict[str, Any]:
    """Select the sections of the parameters that shape a model."""
    return {section: values for section, values in content.items() if section not in EVALUATING_SECTIONS}


@dataclass(frozen=True)
class Link:
    """One step of the way back: what it is, whether it holds, and what was found."""

    name: str
    holds: bool
    found: str


@dataclass(frozen=True)
class Lineage:
    """The way back from one registered version."""

    model: str
    links: tuple[Link, ...]

    @property
    def holds(self) -> bool:
        return all(link.holds for link in self.links)

    def text(self) -> str:
        """Print the way back, one line per link, and which links are broken."""
        width = max(len(link.name) for link in self.links)
        lines = [f"  {'ok' if link.holds else 'BROKEN':<6} {link.name:<{width}}  {link.found}" for link in self.links]
        broken = [link.name for link in self.links if not link.holds]
        end = f"broken: {', '.join(broken)}" if broken else f"all {len(self.links)} links hold"
        return "\n".join(map(printable, [self.model, *lines, end]))


def lineage(uri: str, root: Path) -> Lineage:
    """Follow the way back from ``models:/<name>@<alias>`` or ``models:/<name>/<version>`` and check every link.

    The files of the version must have the hash that was registered. One of them, ``lineage.json``, states the rest:
    run and commit must exist, and ``dvc.lock`` and ``params.yaml`` must hold the hashes of data and parameters, in the
    working tree or in a commit.

    Raises:
        LineageError: The URI has another form, or the registry has no such version.
        TrackingError: The registry cannot be reached.
    """
    root = repository_root(root)
    with open_store(root, create=False) as store, tempfile.TemporaryDirectory() as scratch:
        version = version_of(store, uri)
        model = f"{version.name} version {version.version} ({version.tags.get(REASON, 'no decision')})"
        try:
            folder = download_model(store, version, Path(scratch))
            (path,) = folder.rglob("lineage.json")
            origin = dict(json.loads(path.read_text(encoding="utf-8")))
        except (TrackingError, OSError, ValueError) as error:  # lost or damaged: nothing states the rest
            return Lineage(model, (Link("files", False, str(error)),))
        checks = {"files": partial(_files, folder, version.tags.get(FILES, "nothing"))}
        checks |= {"run": partial(_run, store, origin), "git commit": partial(_commit, root, origin)}
        for name, md5 in origin["data"].items():
            checks[f"data {name.removeprefix('data/')}"] = partial(_data, root, name, md5)
        checks["parameters"] = partial(_params, root, origin["params_sha256"])
        return Lineage(model, tuple(_link(name, check) for name, check in checks.items()))


def _link(name: str, check: Callable[[], str]) -> Link:
    try:
        return Link(name, True, check())
    except LineageError as broken:
        return Link(name, False, str(broken))


def _files(folder: Path, stated: str) -> str:
    if (found := hash_of(folder, WRITTEN_ON_LOADING)) != stated:
        raise LineageError(f"their hash is {found[:12]}…, but {stated[:12]}… was registered")
    return f"hash {found[:12]}… as registered"


def _run(store: Store, origin: Mapping[str, Any]) -> str:
    try:
        run = store.client.get_run(origin["run_id"])
    except MlflowException:
        raise LineageError(f"{origin['run_id']}: not in the store") from None
    found = f"{run.info.run_name} {run.info.run_id} ({run.info.status.lower()}, {run.info.lifecycle_stage})"
    if run.info.lifecycle_stage != "active":
        raise LineageError(found)
    return found


def _commit(root: Path, origin: Mapping[str, Any]) -> str:
    sha = origin["git_commit"]
    if sha == "unknown":
        raise LineageError(f"unknown when the model was made: {origin['git_problem']}")
    words, problem = asked_git(root, "show", "-s", "--format=%s", "--end-of-options", sha)
    if words is None:
        raise LineageError(f"{sha}: not in this repository ({problem}); fetch the branch that holds it")
    return f"{sha[:12]} {words}" + (" (with changes that were not committed)" if origin["git_dirty"] != "false" else "")


def _data(root: Path, path: str, md5: str) -> str:
    where = _where(root, LOCK_FILE, lambda text: locked_hashes(text).get(path) == md5)
    if where is None:
        raise LineageError(f"{md5} in no version of {LOCK_FILE}")
    return f"{md5} in {LOCK_FILE} of {where}"


def _params(root: Path, stated: str) -> str:
    where = _where(root, PARAMS_FILE, lambda text: json_hash(shaping_params(yaml.safe_load(text))) == stated)
    if where is None:
        raise LineageError(f"{stated[:12]}… in no version of {PARAMS_FILE}; lineage.json inside the model holds them")
    return f"{stated[:12]}… in {PARAMS_FILE} of {where}"


def _where(root: Path, file: str, fits: Callable[[str], bool]) -> str | None:
    """Name the version of ``file`` that fits: the working tree's, or that of the newest commit that changed it so."""

    def fitting(text: str) -> bool:
        try:
            return fits(text)
        except (ValueError, AttributeError, yaml.YAMLError):
            return False  # a version with the marks of a merge, for example

    if (root / file).is_file() and fitting((root / file).read_text(encoding="utf-8", errors="replace")):
        return "the working tree"
    commits = (asked_git(root, "log", "--all", "--format=%H", "--", file)[0] or "").split()
    versions = ((sha, asked_git(root, "show", f"{sha}:{file}")[0] or "") for sha in commits)
    return next((f"commit {sha[:12]}" for sha, text in versions if fitting(text)), None)
