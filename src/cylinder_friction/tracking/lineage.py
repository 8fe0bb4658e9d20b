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

from cylinder_friction.evaluation.reported import error_metrics
from cylinder_friction.recordings.files import hash_of
from cylinder_friction.tracking.gate import CANDIDATE_KEY, Decision, decide
from cylinder_friction.tracking.model_folder import (
    ESTIMATOR_ARTIFACT,
    LINEAGE_ARTIFACT,
    artifact_path,
    download_model,
    version_of,
)
from cylinder_friction.tracking.model_version import (
    CONTENT_KEY,
    DECISION,
    GATE,
    LINEAGE,
    MODEL_KEY,
    WRITTEN_ON_LOADING,
    tags_of,
)
from cylinder_friction.tracking.registry import REFUSED_ROLLED_BACK
from cylinder_friction.tracking.repository import TrackingError, code_at, git, repository_root
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
class FoundLink:
    """One step of the way back: what it is, whether it holds, and what was found."""

    name: str
    holds: bool
    found: str


@dataclass(frozen=True)
class Lineage:
    """The way back from one registered version."""

    model: str
    links: tuple[FoundLink, ...]

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
    with open_store(root, create=False) as store, tempfile.TemporaryDirectory() as scratch:
        version = version_of(store, uri)
        folder = _download(store, version, Path(scratch))
        origin = _origin(folder)
        links = [
            _run_link(store, version),
            _commit_link(root, version),
            _code_link(root, origin),
            *_model_links(store, folder, version),
            _tags_link(origin, version),
            _gate_link(store, version),
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


def _run_link(store: Store, version: ModelVersion) -> FoundLink:
    try:
        run = store.client.get_run(version.run_id or "")
    except MlflowException:
        return FoundLink("run", False, f"{version.run_id}: not in the store")
    whole = run.info.lifecycle_stage == "active" and run.info.status == "FINISHED"
    return FoundLink(
        "run", whole, f"{run.info.run_name} {run.info.run_id} ({run.info.status.lower()}, {run.info.lifecycle_stage})"
    )


def _commit_link(root: Path, version: ModelVersion) -> FoundLink:
    origin = json.loads(version.tags.get(LINEAGE, "{}"))
    sha = origin.get("git_commit", "unknown")
    if sha == "unknown":
        return FoundLink("git commit", False, "the code that ran is in no commit of this repository")
    if git(root, "cat-file", "-e", f"{sha}^{{commit}}") is None:
        return FoundLink("git commit", False, f"{sha}: not in this repository; fetch the branch that holds it")
    subject = git(root, "show", "-s", "--format=%s", sha)
    if origin.get("git_dirty") is not False:
        return FoundLink("git commit", True, f"{sha[:12]} {subject} (with changes that were not committed)")
    return FoundLink("git commit", True, f"{sha[:12]} {subject}")


def _code_link(root: Path, origin: dict[str, Any]) -> FoundLink:
    """The commit must hold the code that each stage ran with, by its hash."""
    codes, sha = origin.get("code", {}), origin.get("sha", "unknown")
    unknown = [stage for stage, code in codes.items() if not code]
    if not codes or unknown:
        return FoundLink(
            "code", False, f"{', '.join(unknown) or 'no stage'}: no hash of the code that ran; run `dvc repro -f`"
        )
    other = [stage for stage, code in codes.items() if code_at(root, sha, stage) != code]
    if other:
        return FoundLink("code", False, f"what {', '.join(other)} ran is not the code in commit {sha[:12]}")
    return FoundLink("code", True, f"of {', '.join(codes)} is that of the commit")


def _model_links(store: Store, folder: Path | None, version: ModelVersion) -> Iterator[FoundLink]:
    if folder is None:
        yield FoundLink("model", False, f"its artifacts at {version.source} cannot be read")
        return
    logged = store.client.get_logged_model(str(version.source).removeprefix("models:/"))
    whole, estimator = hash_of(folder, WRITTEN_ON_LOADING), hash_of(artifact_path(folder, ESTIMATOR_ARTIFACT))
    for name, key, found in (("model", MODEL_KEY, estimator), ("model's files", CONTENT_KEY, whole)):
        expected = {version.tags.get(key, "unknown"), logged.tags.get(key, "unknown")}
        if expected == {found}:
            yield FoundLink(name, True, f"content {found[:12]}…")
        else:
            stated = ", ".join(f"{each[:12]}…" for each in sorted(expected))
            yield FoundLink(name, False, f"their hash is {found[:12]}…, but the version was made of {stated}")


def _tags_link(origin: dict[str, Any], version: ModelVersion) -> FoundLink:
    """The tags that a browser shows and the file inside the model must agree."""
    if "gate" not in origin:
        return FoundLink("tags", False, "there is no lineage.json to compare them with")
    differing = [key for key, value in tags_of(origin).items() if version.tags.get(key) != value]
    if differing:
        return FoundLink("tags", False, f"{', '.join(differing)} differ from the lineage.json inside the model")
    return FoundLink("tags", True, "agree with the lineage.json inside the model")


def _gate_link(store: Store, version: ModelVersion) -> FoundLink:
    """The figures must lead to the decision that is stated, and be those of the run of ``register``."""
    tags = version.tags
    try:
        gate, incumbent = json.loads(tags[GATE]), json.loads(tags["gate_incumbent"])
        figures = None if incumbent is None else incumbent["errors_percent"]
        decision = decide(gate["errors_percent"], figures, gate["tolerance_percent"])
        stated = Decision(tags[DECISION] == "promoted", tags["gate_reason"])
    except (KeyError, ValueError, TypeError) as error:
        return FoundLink("gate", False, f"it left no decision that can be checked ({type(error).__name__}: {error})")
    if decision != stated and stated.reason != REFUSED_ROLLED_BACK:
        return FoundLink("gate", False, f"its figures lead to {decision.reason!r}, but it states {stated.reason!r}")
    query = f"attributes.run_name = 'register' and tags.{CANDIDATE_KEY} = '{tags.get(CANDIDATE_KEY)}'"
    runs = store.client.search_runs([store.experiment_id], query)
    if any(
        {**run.data.metrics, **error_metrics(gate["errors_percent"])} == run.data.metrics
        and run.data.tags.get("gate_reason") == stated.reason
        for run in runs
    ):
        return FoundLink("gate", True, stated.reason)
    return FoundLink("gate", False, f"no run of register in {store.uri} has its figures; run `cylinder-friction track`")


def _data_links(root: Path, origin: dict[str, Any]) -> Iterator[FoundLink]:
    data = origin.get("data", {})
    for path in sorted(data, key=lambda path: (path != origin["raw"], path)):  # from the beginning on
        md5 = data[path]
        locked = _where_in_history(
            root, LOCK_FILE, lambda text, path=path, md5=md5: locked_hashes(text).get(path) == md5  # type: ignore[misc]
        )  # fmt: skip
        name = f"{LOCK_FILE} {path.removeprefix('data/')}"
        yield FoundLink(
            name, locked is not None, f"{md5} {f'in {locked}' if locked else f'in no commit of {LOCK_FILE}'}"
        )
        yield FoundLink(f"data {path.removeprefix('data/')}", *where_data_lies(root, path, md5))


def _params_link(root: Path, origin: dict[str, Any]) -> FoundLink:
    if not origin:
        return FoundLink("parameters", False, "there is no lineage.json to read them from")
    expected = origin["params_sha256"]
    if params_hash(origin["params"]) != expected:
        return FoundLink("parameters", False, "those inside the model are not those it was registered with")
    where = _where_in_history(
        root, PARAMS_FILE, lambda text: params_hash(shaping_params(yaml.safe_load(text) or {})) == expected
    )
    if where is not None:
        return FoundLink("parameters", True, f"{expected[:12]}… in {where}")
    path = root / PARAMS_FILE
    now = shaping_params(yaml.safe_load(path.read_text(encoding="utf-8")) or {}) if path.is_file() else {}
    return FoundLink("parameters", False, f"{_differences(origin['params'], now)}, and no commit has them as they were")


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
