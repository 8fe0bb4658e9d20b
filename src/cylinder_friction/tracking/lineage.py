"""Lineage of a registered model: its run, commit, data and parameters, with a check of each link."""

import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import yaml
from mlflow.exceptions import MlflowException

from cylinder_friction.dvc_hashes import LOCK_FILE, locked_hashes
from cylinder_friction.files.whole_files import hash_of, json_hash, read_json
from cylinder_friction.tracking.model_folder import download_model, version_of
from cylinder_friction.tracking.model_version import FILES, REASON, WRITTEN_ON_LOADING
from cylinder_friction.tracking.repository import TrackingError, asked_git, repository_root
from cylinder_friction.tracking.store import Store, open_store
from cylinder_friction.wording import printable

PARAMS_FILE = "params.yaml"
EVALUATING_SECTIONS = ("recipe", "lugre", "compare", "register")
"""Sections of the parameters that do not shape the model; all other sections belong to its origin."""


def shaping_params(content: Mapping[str, Any]) -> dict[str, Any]:
    """Select the sections of the parameters that shape a model."""
    return {section: values for section, values in content.items() if section not in EVALUATING_SECTIONS}


@dataclass(frozen=True)
class Link:
    """One link of the lineage: its name, whether it holds, and what was found."""

    name: str
    holds: bool
    found: str


@dataclass(frozen=True)
class Lineage:
    """The lineage of one registered version."""

    model: str
    links: tuple[Link, ...]

    @property
    def holds(self) -> bool:
        return all(link.holds for link in self.links)

    def text(self) -> str:
        """Format the lineage as text: one line per link, then the broken links."""
        width = max(len(link.name) for link in self.links)
        lines = [f"  {'ok' if link.holds else 'BROKEN':<6} {link.name:<{width}}  {link.found}" for link in self.links]
        broken = [link.name for link in self.links if not link.holds]
        end = f"broken: {', '.join(broken)}" if broken else f"all {len(self.links)} links hold"
        return "\n".join(map(printable, [self.model, *lines, end]))


def lineage(uri: str, root: Path) -> Lineage:
    """Check every link of the lineage of ``models:/<name>@<alias>`` or ``models:/<name>/<version>``.

    The files of the version must have the registered hash. One of them, ``lineage.json``, states the other links: run
    and commit must exist, and ``dvc.lock`` and ``params.yaml`` must contain the hashes of data and parameters, in the
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
            origin = dict(read_json(path))
        except (TrackingError, OSError, ValueError) as error:  # lost or damaged: nothing states the other links
            return Lineage(model, (Link("files", False, str(error)),))
        links = [
            _files(folder, version.tags.get(FILES, "nothing")),
            _run(store, origin["run_id"]),
            _commit(root, origin),
        ]
        for name, md5 in origin["data"].items():
            own = f"data {name.removeprefix('data/')}"
            links.append(_stated(own, md5, root, LOCK_FILE, partial(_locked_hash, name)))
        shaping = json_hash(origin["params"])
        links.append(_stated("parameters", shaping, root, PARAMS_FILE, _shaping_hash))
        return Lineage(model, tuple(links))


def _files(folder: Path, stated: str) -> Link:
    found = hash_of(folder, WRITTEN_ON_LOADING)
    if found != stated:
        return Link("files", False, f"their hash is {found[:12]}…, but {stated[:12]}… was registered")
    return Link("files", True, f"hash {found[:12]}… as registered")


def _run(store: Store, run_id: str) -> Link:
    try:
        run = store.client.get_run(run_id).info
    except MlflowException:
        return Link("run", False, f"{run_id}: not in the store")
    words = f"{run.run_name} {run_id} ({run.status.lower()}, {run.lifecycle_stage})"
    return Link("run", run.lifecycle_stage == "active", words)


def _commit(root: Path, origin: Mapping[str, Any]) -> Link:
    sha = origin["git_commit"]
    if sha == "unknown":
        return Link("git commit", False, f"unknown when the model was made: {origin['git_problem']}")
    words, problem = asked_git(root, "show", "-s", "--format=%s", "--end-of-options", sha)
    if words is None:
        return Link("git commit", False, f"{sha}: not in this repository ({problem}); fetch the branch that holds it")
    modified = " (with changes that were not committed)" if origin["git_dirty"] != "false" else ""
    return Link("git commit", True, f"{sha[:12]} {words}{modified}")


def _locked_hash(path: str, text: str) -> str | None:
    return locked_hashes(text).get(path)


def _shaping_hash(text: str) -> str:
    return json_hash(shaping_params(yaml.safe_load(text)))


def _stated(name: str, stated: str, root: Path, file: str, read: Callable[[str], str | None]) -> Link:
    """Find the version of ``file``, in the working tree or a commit, from which ``read`` reads the stated hash."""
    for where, text in _versions(root, file):
        with suppress(ValueError, AttributeError, yaml.YAMLError):  # the marks of a merge, for example
            if read(text) == stated:
                return Link(name, True, f"{stated[:36]} in {file} of {where}")
    advice = "fetch the branch that holds it, or read lineage.json inside the model"
    return Link(name, False, f"{stated[:36]} in no version of {file}; {advice}")


def _versions(root: Path, file: str) -> Iterator[tuple[str, str]]:
    """Yield a file's text in the working tree, then in each commit that changed it, newest first."""
    if (root / file).is_file():
        yield "the working tree", (root / file).read_text(encoding="utf-8", errors="replace")
    for sha in (asked_git(root, "log", "--all", "--format=%H", "--", file)[0] or "").split():
        yield f"commit {sha[:12]}", asked_git(root, "show", f"{sha}:{file}")[0] or ""
