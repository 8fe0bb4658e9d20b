"""The way back: from a registered model to its run, its commit, its data and its parameters, each link checked."""

import json
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import yaml
from mlflow.entities.model_registry import ModelVersion
from mlflow.exceptions import MlflowException

from cylinder_friction.dvc_hashes import LOCK_FILE, locked_hashes
from cylinder_friction.files.whole_files import hash_of, json_hash
from cylinder_friction.tracking.model_folder import download_model, version_of
from cylinder_friction.tracking.model_version import COMMIT, FILES, REASON, WRITTEN_ON_LOADING
from cylinder_friction.tracking.repository import LineageError, TrackingError, asked_git, git, repository_root
from cylinder_friction.tracking.store import Store, open_store
from cylinder_friction.wording import printable

PARAMS_FILE = "params.yaml"
EVALUATING_SECTIONS = ("recipe", "lugre", "compare", "register")
"""Sections of the parameters that do not shape the model; all others belong to its origin."""


def shaping_params(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return the sections of the parameters that shape a model."""
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
        """Return the way back, one line per link, and what is broken."""
        width = max(len(link.name) for link in self.links)
        lines = [f"  {'ok' if link.holds else 'BROKEN':<6} {link.name:<{width}}  {link.found}" for link in self.links]
        broken = [link.name for link in self.links if not link.holds]
        end = f"broken: {', '.join(broken)}" if broken else f"all {len(self.links)} links hold"
        return "\n".join(map(printable, [self.model, *lines, end]))


def lineage(uri: str, root: Path) -> Lineage:
    """Follow the way back from ``models:/<name>@<alias>`` or ``models:/<name>/<version>`` and check every link.

    The files of the version must have the hash that was registered. Among them is ``lineage.json``: its run and commit
    must be there, and its hashes of data and parameters in ``dvc.lock`` and ``params.yaml``, now or in a commit.

    Raises:
        LineageError: The URI has another form, or the registry has no such version.
        TrackingError: The registry cannot be reached.
    """
    root = repository_root(root)
    with open_store(root, create=False) as store, tempfile.TemporaryDirectory() as scratch:
        version = version_of(store, uri)
        links = [_link("files", lambda: _files(store, version, Path(scratch)))]
        try:
            (path,) = Path(scratch).rglob("lineage.json")
            origin = dict(json.loads(path.read_text(encoding="utf-8")))
        except (OSError, ValueError, TypeError):
            origin = {}
        links.append(_link("run", lambda: _run(store, version, origin["run_id"])))
        links.append(_link("git commit", lambda: _commit(root, version, origin)))
        for name, md5 in origin.get("data", {}).items():
            links.append(_link(f"data {name.removeprefix('data/')}", partial(_data, root, name, md5)))
        links.append(_link("parameters", lambda: _params(root, origin)))
    return Lineage(
        f"{version.name} version {version.version} ({version.tags.get(REASON, 'no decision')})", tuple(links)
    )


def _link(name: str, check: Callable[[], str]) -> Link:
    try:
        return Link(name, True, check())
    except TrackingError as broken:
        return Link(name, False, str(broken))
    except (KeyError, ValueError, TypeError, AttributeError) as error:
        return Link(name, False, f"lineage.json inside the model does not state it ({type(error).__name__}: {error})")


def _files(store: Store, version: ModelVersion, scratch: Path) -> str:
    found = hash_of(download_model(store, version, scratch), WRITTEN_ON_LOADING)
    if found != (stated := version.tags.get(FILES, "nothing")):
        raise LineageError(f"their hash is {found[:12]}…, but {stated[:12]}… was registered")
    return f"hash {found[:12]}… as registered"


def _run(store: Store, version: ModelVersion, stated: str) -> str:
    if version.run_id != stated:
        raise LineageError(f"the version names run {version.run_id}, but its model was made by {stated}")
    try:
        run = store.client.get_run(stated)
    except MlflowException:
        raise LineageError(f"{stated}: not in the store") from None
    found = f"{run.info.run_name} {run.info.run_id} ({run.info.status.lower()}, {run.info.lifecycle_stage})"
    if (run.info.lifecycle_stage, run.info.status) != ("active", "FINISHED"):
        raise LineageError(found)
    return found


def _commit(root: Path, version: ModelVersion, origin: dict[str, Any]) -> str:
    sha = str(origin["git_commit"])
    if sha != version.tags.get(COMMIT):
        raise LineageError(f"the version names {version.tags.get(COMMIT)}, but its model was made at {sha}")
    if sha == "unknown":
        raise LineageError(f"unknown when the model was made: {origin.get('git_problem', 'git did not answer')}")
    words, problem = asked_git(root, "show", "-s", "--format=%s", "--end-of-options", sha)
    if words is None:
        raise LineageError(f"{sha}: not in this repository ({problem}); fetch the branch that holds it")
    return f"{sha[:12]} {words}" + (" (with changes that were not committed)" if origin["git_dirty"] != "false" else "")


def _data(root: Path, path: str, md5: str) -> str:
    where = _where(root, LOCK_FILE, lambda text: locked_hashes(text).get(path) == md5)
    if where is None:
        raise LineageError(f"{md5} in no version of {LOCK_FILE}")
    return f"{md5} in {LOCK_FILE} of {where}"


def _params(root: Path, origin: dict[str, Any]) -> str:
    stated = str(origin["params_sha256"])
    where = _where(root, PARAMS_FILE, lambda text: json_hash(shaping_params(yaml.safe_load(text) or {})) == stated)
    if where is None:
        raise LineageError(f"{stated[:12]}… in no version of {PARAMS_FILE}; lineage.json inside the model holds them")
    return f"{stated[:12]}… in {PARAMS_FILE} of {where}"


def _where(root: Path, file: str, fits: Callable[[str], bool]) -> str | None:
    """Return where a version of ``file`` fits: the working tree, or the newest commit that changed it so."""

    def fitting(text: str | None) -> bool:
        try:
            return text is not None and fits(text)
        except (ValueError, TypeError, AttributeError, yaml.YAMLError):
            return False  # a version with the marks of a merge, for example

    if (root / file).is_file() and fitting((root / file).read_bytes().decode(errors="replace")):
        return "the working tree"
    commits = (git(root, "log", "--all", "--format=%H", "--", file) or "").split()
    return next((f"commit {sha[:12]}" for sha in commits if fitting(git(root, "show", f"{sha}:{file}"))), None)
