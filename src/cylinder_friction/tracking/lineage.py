"""Registered versions: look one up, copy its files, and check its lineage: run, commit, data and parameters."""

import re
import tempfile
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml
from mlflow import artifacts
from mlflow.entities.model_registry import ModelVersion
from mlflow.exceptions import MlflowException
from mlflow.models import Model

from cylinder_friction.dvc_hashes import LOCK_FILE
from cylinder_friction.files.whole_files import hash_of, json_hash, read_json
from cylinder_friction.tracking.repository import SOURCES, TrackingError, asked_git, repository_root
from cylinder_friction.tracking.store import Store, open_store
from cylinder_friction.wording import in_brief, printable

REASON, FILES = "reason", "hash_files"  # Tags of a version: why it was promoted or refused; the hash of its files
WRITTEN_ON_LOADING = "registered_model_meta"
"""File that MLflow adds to a model when it loads the model by its registered name; the hash leaves the file out."""
REGISTER_AGAIN = "`cylinder-friction stage register`, which registers the present results"
"""Command for a version that was deleted: `dvc repro` finds nothing to run then."""
LOST = f"restore them from a backup, or delete the version in the MLflow UI and run {REGISTER_AGAIN}"
EVALUATING_SECTIONS = ("recipe", "lugre", "compare", "register")
"""Sections of the parameters that do not shape the model; all other sections belong to its origin."""


def shaping_params(content: Mapping[str, Any]) -> dict[str, Any]:
    """Select the sections of the parameters that shape a model."""
    return {section: values for section, values in content.items() if section not in EVALUATING_SECTIONS}


def version_of(store: Store, uri: str) -> ModelVersion:
    """Look up the registered version that ``models:/<name>@<alias>`` or ``models:/<name>/<version>`` names.

    Raises:
        TrackingError: The URI has another form, or the registry has no such version.
    """
    parts = re.fullmatch(r"models:/([^/@]+)([/@])([^/@]+)", uri)
    if parts is None:
        raise TrackingError(f"{uri!r} names no registered model; expected models:/<name>@<alias> or .../<version>")
    client, (name, kind, which) = store.client, parts.groups()
    try:
        return client.get_model_version_by_alias(name, which) if kind == "@" else client.get_model_version(name, which)
    except MlflowException as error:
        raise TrackingError(
            f"{uri}: the registry at {store.uri} has no such version ({error.message}); {way_to_a_version(store, name)}"
        ) from error


def way_to_a_version(store: Store, name: str) -> str:
    """Advise in words how a registered model gets a version, or which of its versions there are."""
    way = f"run `dvc repro` or, if it has nothing left to run, {REGISTER_AGAIN}"
    found = store.client.search_model_versions(f"name = '{name}'")
    if not found:
        return way
    numbers = ", ".join(map(str, sorted(int(each.version) for each in found)))
    promote = f"`cylinder-friction promote VERSION {name}` makes one the champion"
    return f"it has versions {numbers}: name one, or {promote}; for a new one {way}"


def download_model(store: Store, version: ModelVersion, folder: Path) -> Path:
    """Copy the model folder of a registered version into ``folder``; return its path, from which MLflow loads it.

    Raises:
        TrackingError: The version's files cannot be read.
    """
    try:
        location = store.client.get_model_version_download_uri(version.name, version.version)
        return Path(artifacts.download_artifacts(location, dst_path=str(folder), tracking_uri=store.uri))
    except Exception as error:  # each kind of storage raises its own errors
        where = f"{version.name} version {version.version}: its files at {version.source}"
        raise TrackingError(f"{where} cannot be read ({in_brief(error)}); if they are lost, {LOST}") from error


def download_estimator(store: Store, version: ModelVersion, folder: Path) -> Path:
    """Copy the model folder of a registered version like ``download_model``; return the estimator's folder inside."""
    copied = download_model(store, version, folder)
    return copied / str(Model.load(str(copied)).flavors["python_function"]["artifacts"]["estimator"]["path"])


def estimator_folder(uri: str, root: Path, scratch: Path) -> tuple[Path, str]:
    """Copy the estimator inside a registered model into ``scratch``; return its folder and the version's URI.

    Raises:
        TrackingError: The registry cannot be reached or has no such model.
    """
    with open_store(root, create=False) as store:
        version = version_of(store, uri)
        return download_estimator(store, version, scratch), f"models:/{version.name}/{version.version}"


@dataclass(frozen=True)
class Lineage:
    """The lineage of one registered version."""

    model: str
    links: dict[str, tuple[bool, str]]  # By name: whether the link holds, and what was found
    place: str = ""  # Where its files lie: a copied store names those of the original; empty if none can be read

    @property
    def holds(self) -> bool:
        return all(holds for holds, _ in self.links.values())

    def text(self) -> str:
        """Format the lineage as text: one line per link, then the broken links."""
        links, width = self.links.items(), max(map(len, self.links))
        lines = [f"  {'ok' if holds else 'BROKEN':<6} {name:<{width}}  {words}" for name, (holds, words) in links]
        broken = ", ".join(name for name, (holds, _) in links if not holds)
        end = f"broken: {broken}" if broken else f"all {len(self.links)} links hold for the files at {self.place}"
        return "\n".join(map(printable, [self.model, *lines, end]))


def lineage(uri: str, root: Path) -> Lineage:
    """Check every link of the lineage of ``models:/<name>@<alias>`` or ``models:/<name>/<version>``.

    The files of the version must have the registered hash. One of them, ``lineage.json``, states the other links: run
    and commit must exist, and ``dvc.lock`` and ``params.yaml`` must contain the hashes of the data and the parameters,
    in the working tree or in a commit.

    Raises:
        TrackingError: The registry cannot be reached or has no such version, or the URI has another form.
    """
    root = repository_root(root)
    with open_store(root, create=False) as store, tempfile.TemporaryDirectory() as scratch:
        version = version_of(store, uri)
        model = f"{version.name} version {version.version} ({version.tags.get(REASON, 'no decision')})"
        try:
            folder = download_model(store, version, Path(scratch))
            place = store.client.get_model_version_download_uri(version.name, version.version)
            (path,) = folder.rglob("lineage.json")
            origin = dict(read_json(path))
        except (TrackingError, OSError, ValueError) as error:  # lost or damaged: nothing states the other links
            return Lineage(model, {"files": (False, str(error))})
        found, stated = hash_of(folder, WRITTEN_ON_LOADING), version.tags.get(FILES, "nothing")
        links = {"files": (found == stated, f"their hash is {found[:12]}…, and {stated[:12]}… was registered")}
        try:
            run = store.client.get_run(origin["run_id"]).info
            words = f"{run.run_name} {run.run_id} ({run.status.lower()}, {run.lifecycle_stage})"
            links["run"] = (run.lifecycle_stage == "active", words)
        except MlflowException:
            links["run"] = (False, f"{origin['run_id']}: not in the store")
    links["git commit"] = _commit(root, origin)
    for name, md5 in origin["data"].items():
        links[f"data {name.removeprefix('data/')}"] = _found(root, LOCK_FILE, md5, str)
    own = json_hash(origin["params"])
    links["parameters"] = _found(root, "params.yaml", own, lambda text: json_hash(shaping_params(yaml.safe_load(text))))
    return Lineage(model, links, place)


def _commit(root: Path, origin: Mapping[str, Any]) -> tuple[bool, str]:
    sha = origin["git_commit"]
    if sha == "unknown":
        return False, f"unknown when the model was made: {origin['git_problem']}"
    words, problem = asked_git(root, "show", "-s", "--format=%s", "--end-of-options", sha)
    if words is None:
        return False, f"{sha}: not in this repository ({problem}); fetch the branch that holds it"
    modified = " (with changes that were not committed)" if origin["git_dirty"] != "false" else ""
    same = asked_git(root, "diff", "--quiet", sha, "HEAD", "--", *SOURCES)[0] is not None
    head, code = asked_git(root, "rev-parse", "--short=12", "HEAD")[0], "the same" if same else "other"
    return True, f"{sha[:12]} {words}{modified}; HEAD is {head}, with {code} code"


def _found(root: Path, file: str, md5: str, read: Callable[[str], str]) -> tuple[bool, str]:
    """Look for a hash in what is ``read`` of a file: in the working tree, then in each commit, newest first."""
    commits = (asked_git(root, "log", "--all", "--format=%h", "--", file)[0] or "").split()
    texts = ((f"commit {sha}", asked_git(root, "show", f"{sha}:{file}")[0] or "") for sha in commits)
    here = (root / file).read_text(encoding="utf-8", errors="replace") if (root / file).is_file() else ""
    for where, text in (("the working tree", here), *texts):
        with suppress(ValueError, AttributeError, yaml.YAMLError):  # the marks of a merge, for example
            if md5 in read(text):
                return True, f"{md5[:36]} in {file} of {where}"
    return False, f"{md5[:36]} in no version of {file}; fetch the branch that holds it"
