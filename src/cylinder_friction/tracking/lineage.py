"""The way back: from a registered model to its run, its commit, its data and its parameters, each link checked."""

import json
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml
from mlflow.entities.model_registry import ModelVersion
from mlflow.exceptions import MlflowException

from cylinder_friction.recordings.files import hash_of
from cylinder_friction.tracking.model_folder import (
    ESTIMATOR_ARTIFACT,
    LINEAGE_ARTIFACT,
    artifact_path,
    download_model,
    version_of,
)
from cylinder_friction.tracking.repository import TrackingError, git, repository_root
from cylinder_friction.tracking.store import Store, open_store
from cylinder_friction.tracking.versions import (
    LOCK_FILE,
    PARAMS_FILE,
    locked_hashes,
    params_hash,
    shaping_params,
    where_data_lies,
)


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
        lines = [self.model]
        lines += [f"  {'ok    ' if link.holds else 'BROKEN'} {link.name:<{width}}  {link.found}" for link in self.links]
        broken = [link.name for link in self.links if not link.holds]
        lines.append(f"broken: {', '.join(broken)}" if broken else f"all {len(self.links)} links hold")
        return "\n".join(lines)


def lineage(uri: str, root: Path) -> Lineage:
    """Follow the way back from ``models:/<name>@<alias>`` or ``models:/<name>/<version>`` and check every link.

    Raises:
        LineageError: The URI has another form, or the registry has no such version.
        TrackingError: The registry cannot be reached.
    """
    root = repository_root(root)
    with open_store(root) as store, tempfile.TemporaryDirectory() as scratch:
        version = version_of(store, uri)
        folder = _download(store, version, Path(scratch))
        origin = _origin(folder)
        links = [
            _run_link(store, version),
            _commit_link(root, version),
            _model_link(folder, version),
            _tags_link(origin, version),
            *_data_links(root, origin),
            _params_link(root, origin),
        ]
    return Lineage(
        f"{version.name} version {version.version} ({version.tags.get('gate_reason', 'no decision')})", tuple(links)
    )


def _download(store: Store, version: ModelVersion, scratch: Path) -> Path | None:
    try:
        return download_model(store, version, scratch)
    except TrackingError:
        return None


def _origin(folder: Path | None) -> dict[str, Any]:
    if folder is None:
        return {}
    content: dict[str, Any] = json.loads(artifact_path(folder, LINEAGE_ARTIFACT).read_text(encoding="utf-8"))
    return content


def _run_link(store: Store, version: ModelVersion) -> Link:
    try:
        run = store.client.get_run(version.run_id or "")
    except MlflowException:
        return Link("run", False, f"{version.run_id}: not in the store")
    whole = run.info.lifecycle_stage == "active" and run.info.status == "FINISHED"
    return Link(
        "run", whole, f"{run.info.run_name} {run.info.run_id} ({run.info.status.lower()}, {run.info.lifecycle_stage})"
    )


def _commit_link(root: Path, version: ModelVersion) -> Link:
    sha = version.tags.get("git_commit", "unknown")
    if git(root, "cat-file", "-e", f"{sha}^{{commit}}") is None:
        return Link("git commit", False, f"{sha}: not in this repository; fetch the branch that holds it")
    subject = git(root, "show", "-s", "--format=%s", sha)
    if version.tags.get("git_dirty") != "false":
        return Link("git commit", True, f"{sha[:12]} {subject} (with changes that were not committed)")
    return Link("git commit", True, f"{sha[:12]} {subject}")


def _model_link(folder: Path | None, version: ModelVersion) -> Link:
    key = version.tags.get("model_key", "unknown")
    if folder is None:
        return Link("model", False, f"its artifacts at {version.source} cannot be read")
    found = hash_of(artifact_path(folder, ESTIMATOR_ARTIFACT))
    if found != key:
        return Link(
            "model", False, f"the registered files' hash is {found[:12]}…, but the version was made of {key[:12]}…"
        )
    return Link("model", True, f"content {key[:12]}…")


def _tags_link(origin: dict[str, Any], version: ModelVersion) -> Link:
    """The tags that a browser shows and the file inside the model must agree."""
    if not origin:
        return Link("tags", False, "there is no lineage.json to compare them with")
    expected = {
        "git_commit": origin["sha"],
        "data_raw_md5": origin["data"][origin["raw"]],
        "params_sha256": params_hash(origin["params"]),
        "model_key": origin["model_key"],
    }
    differing = [key for key, value in expected.items() if version.tags.get(key) != value]
    if differing:
        return Link("tags", False, f"{', '.join(differing)} differ from the lineage.json inside the model")
    return Link("tags", True, "agree with the lineage.json inside the model")


def _data_links(root: Path, origin: dict[str, Any]) -> Iterator[Link]:
    data = origin.get("data", {})
    for path in sorted(data, key=lambda path: (path != origin["raw"], path)):  # from the beginning on
        md5 = data[path]
        locked = _where_in_history(
            root, LOCK_FILE, lambda text, path=path, md5=md5: locked_hashes(text).get(path) == md5  # type: ignore[misc]
        )  # fmt: skip
        name = f"{LOCK_FILE} {path.removeprefix('data/')}"
        yield Link(name, locked is not None, f"{md5} {f'in {locked}' if locked else f'in no commit of {LOCK_FILE}'}")
        lies = where_data_lies(root, path, md5)
        name = f"data {path.removeprefix('data/')}"
        yield Link(name, lies is not None, lies or "neither on disk nor whole in DVC's cache; run `dvc pull`")


def _params_link(root: Path, origin: dict[str, Any]) -> Link:
    if not origin:
        return Link("parameters", False, "there is no lineage.json to read them from")
    expected = origin["params_sha256"]
    if params_hash(origin["params"]) != expected:
        return Link("parameters", False, "those inside the model are not those it was registered with")
    where = _where_in_history(
        root, PARAMS_FILE, lambda text: params_hash(shaping_params(yaml.safe_load(text) or {})) == expected
    )
    if where is not None:
        return Link("parameters", True, f"{expected[:12]}… in {where}")
    path = root / PARAMS_FILE
    now = shaping_params(yaml.safe_load(path.read_text(encoding="utf-8")) or {}) if path.is_file() else {}
    return Link("parameters", False, f"{_differences(origin['params'], now)}, and no commit has them as they were")


def _where_in_history(root: Path, file: str, fits: Callable[[str], bool]) -> str | None:
    """Return where a version of ``file`` fits: the working tree, or the newest commit that changed it so."""
    path = root / file
    if path.is_file() and fits(path.read_text(encoding="utf-8")):
        return "the working tree"
    for sha in (git(root, "log", "--all", "--format=%H", "--", file) or "").split():
        text = git(root, "show", f"{sha}:{file}")
        if text is not None and fits(text):
            return f"commit {sha[:12]}"
    return None


def _differences(then: dict[str, Any], now: dict[str, Any], prefix: str = "") -> str:
    found = []
    for key in sorted(set(then) | set(now)):
        before, after = then.get(key), now.get(key)
        if before == after:
            continue
        if isinstance(before, dict) and isinstance(after, dict):
            found.append(_differences(before, after, f"{prefix}{key}."))
        else:
            found.append(f"{prefix}{key} was {before}, is {after}")
    return "; ".join(found)
