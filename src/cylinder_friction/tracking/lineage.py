"""The way back: from a registered model to its run, its commit, its data and its parameters, each link checked."""

import json
import marshal
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib.util import MAGIC_NUMBER, source_from_cache
from pathlib import Path
from typing import Any

import yaml
from mlflow.entities.model_registry import ModelVersion
from mlflow.exceptions import MlflowException
from mlflow.models import Model

from cylinder_friction.evaluation.reported import error_metrics
from cylinder_friction.recordings.files import hash_of, json_hash
from cylinder_friction.tracking.executions import CANDIDATE_KEY
from cylinder_friction.tracking.gate import Decision, decide
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
    RUN_KEY,
    WRITTEN_ON_LOADING,
    run_content,
    tags_of,
)
from cylinder_friction.tracking.registry import PROMOTED, REFUSED_ROLLED_BACK, ROLLED_BACK
from cylinder_friction.tracking.repository import TrackingError, code_at, git, repository_root
from cylinder_friction.tracking.store import Store, open_store
from cylinder_friction.tracking.versions import (
    LOCK_FILE,
    PARAMS_FILE,
    locked_hashes,
    shaping_params,
    where_data_lies,
)
from cylinder_friction.wording import in_brief, printable

_REFUSED_CODES = ("RESOURCE_DOES_NOT_EXIST", "INVALID_PARAMETER_VALUE")
"""MLflow's, of what a version names and is not there; others, as of a server that is gone, are no broken link."""


@dataclass(frozen=True)
class FoundLink:
    """One step of the way back: what it is, whether it holds, and what was found."""

    name: str
    holds: bool
    found: str
    checked: bool = True


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
        words = {link: "BROKEN" if not link.holds else "ok" if link.checked else "?" for link in self.links}
        lines += [f"  {words[link]:<6} {link.name:<{width}}  {link.found}" for link in self.links]
        broken = [link.name for link in self.links if not link.holds]
        unknown = [link.name for link in self.links if not link.checked]
        whole = f"all {len(self.links) - len(unknown)} links hold" + ("; not checked: " if unknown else "")
        lines.append(f"broken: {', '.join(broken)}" if broken else whole + ", ".join(unknown))
        return "\n".join(map(printable, lines))


class _BrokenLinkError(Exception):
    """A link does not hold; the message states what was found."""


class _NotCheckedError(Exception):
    """Nothing is there to compare a link with; the message states what was found."""


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
        origin = {} if folder is None else _origin(folder)
        checks: list[tuple[str, Callable[[], str]]] = [
            ("run", partial(_run, store, folder, version)),
            ("run's figures", partial(_figures, store, origin, version)),
            ("git commit", partial(_commit, root, version)),
            ("code", partial(_code, root, origin)),
            ("model", partial(_model, store, folder, version, MODEL_KEY)),
            *([("model's files", partial(_model, store, folder, version, CONTENT_KEY))] if folder else []),
            ("tags", partial(_tags, origin, version)),
            ("gate", partial(_gate, store, version)),
            *([("promotion", partial(_promotion, version))] if {PROMOTED, ROLLED_BACK} & {*version.tags} else []),
        ]
        data: dict[str, str] = origin.get("data", {})
        for each in sorted(data, key=lambda each: (each != origin["raw"], each)):  # from the beginning on
            name = each.removeprefix("data/")
            checks.append((f"{LOCK_FILE} {name}", partial(_locked, root, each, data[each])))
            checks.append((f"data {name}", partial(_data, root, each, data[each])))
        checks.append(("parameters", partial(_params, root, origin)))
        links = tuple(_followed(name, check) for name, check in checks)
    return Lineage(
        f"{version.name} version {version.version} ({version.tags.get('gate_reason', 'no decision')})", links
    )


def _followed(name: str, check: Callable[[], str]) -> FoundLink:
    try:
        return FoundLink(name, True, check())
    except _BrokenLinkError as broken:
        return FoundLink(name, False, str(broken))
    except _NotCheckedError as found:
        return FoundLink(name, True, str(found), checked=False)
    except Exception as error:  # a store, a file or a tag may hold anything
        if isinstance(error, MlflowException) and error.error_code not in _REFUSED_CODES:
            raise
        why = f"{type(error).__name__}: {in_brief(error)}"
        return FoundLink(name, False, f"what it is checked by cannot be read ({why})")


def _download(store: Store, version: ModelVersion, scratch: Path) -> Path | None:
    try:
        return download_model(store, version, scratch)
    except TrackingError:
        return None


def _origin(folder: Path) -> dict[str, Any]:
    try:
        origin: dict[str, Any] = json.loads(artifact_path(folder, LINEAGE_ARTIFACT).read_text(encoding="utf-8"))
        return origin if origin["raw"] in dict(origin["data"]) else {}
    except Exception:  # whatever lies there; each link that needs it is broken then
        return {}


def _run(store: Store, folder: Path | None, version: ModelVersion) -> str:
    """The run must be there, whole, and the one that the files of the model and the logged model name."""
    made = None if folder is None else Model.load(str(folder)).run_id
    logged = store.logged_model(version).source_run_id
    if {version.run_id} != {logged, version.run_id if folder is None else made}:
        raise _BrokenLinkError(f"the version names run {version.run_id}, but its model was made by {made or logged}")
    try:
        run = store.client.get_run(version.run_id or "")
    except MlflowException:
        raise _BrokenLinkError(f"{version.run_id}: not in the store") from None
    found = f"{run.info.run_name} {run.info.run_id} ({run.info.status.lower()}, {run.info.lifecycle_stage})"
    if (run.info.lifecycle_stage, run.info.status) != ("active", "FINISHED"):
        raise _BrokenLinkError(found)
    return found


def _figures(store: Store, origin: dict[str, Any], version: ModelVersion) -> str:
    """The run's metrics and the digests of its datasets must be those that the model was registered with."""
    if RUN_KEY not in origin:
        raise _NotCheckedError("the model was registered before its files held them")
    try:
        run = store.client.get_run(version.run_id or "")
    except MlflowException:
        raise _BrokenLinkError(f"{version.run_id}: not in the store") from None
    used = {each.dataset.name: each.dataset.digest for each in (run.inputs.dataset_inputs if run.inputs else ())}
    found, wanted = run_content(run.data.metrics, used), origin[RUN_KEY]
    for kind in ("metrics", "datasets"):
        for name in sorted({*wanted[kind], *found[kind]}):
            value, now = wanted[kind].get(name, "missing"), found[kind].get(name, "missing")
            if now != value:
                raise _BrokenLinkError(f"{kind}: {name} is {now} in the store, but {value} in the model's files")
    return f"{len(wanted['metrics'])} metrics and {len(wanted['datasets'])} datasets as the model's files state them"


def _promotion(version: ModelVersion) -> str:
    stated = [f"{name} {version.tags[name]}" for name in (PROMOTED, ROLLED_BACK) if name in version.tags]
    raise _NotCheckedError("; ".join(stated))


def _commit(root: Path, version: ModelVersion) -> str:
    try:
        origin = dict(json.loads(version.tags.get(LINEAGE, "{}")))
    except (ValueError, TypeError):
        raise _BrokenLinkError(f"the tag {LINEAGE!r} is no JSON object") from None
    sha = origin.get("git_commit", "unknown")
    if sha == "unknown":
        raise _BrokenLinkError("the code that ran is in no commit of this repository")
    if git(root, "cat-file", "-e", f"{sha}^{{commit}}") is None:
        raise _BrokenLinkError(f"{sha}: not in this repository; fetch the branch that holds it")
    dirty = "" if origin.get("git_dirty") is False else " (with changes that were not committed)"
    return f"{sha[:12]} {git(root, 'show', '-s', '--format=%s', sha)}{dirty}"


def _code(root: Path, origin: dict[str, Any]) -> str:
    """The commit must hold the code that each stage ran with, by its hash."""
    codes, sha = origin.get("code", {}), origin.get("sha", "unknown")
    unknown = [stage for stage, code in codes.items() if not code]
    if not codes or unknown:
        raise _BrokenLinkError(f"{', '.join(unknown) or 'no stage'}: no hash of the code that ran; run `dvc repro -f`")
    other = [stage for stage, code in codes.items() if code_at(root, sha, stage) != code]
    if other:
        raise _BrokenLinkError(f"what {', '.join(other)} ran is not the code in commit {sha[:12]}")
    return f"of {', '.join(codes)} is that of the commit"


def _model(store: Store, folder: Path | None, version: ModelVersion, key: str) -> str:
    """The tag ``key`` of the version and of its logged model must be the hash of what lies in the store."""
    if folder is None:
        raise _BrokenLinkError(f"its artifacts at {version.source} cannot be read")
    logged = store.logged_model(version)
    whole = key == CONTENT_KEY
    files = (each for each in folder.rglob("*") if each.is_file())
    cached = [each for each in files if {".pyc", "__pycache__"} & {each.suffix, *each.relative_to(folder).parts}]
    if whole and (foreign := [each for each in cached if not _is_compiled_source(each)]):
        raise _BrokenLinkError(
            f"{foreign[0].relative_to(folder)} is not what this Python makes of its source, but MLflow would run "
            "it where the version of Python fits; remove it"
        )
    found = hash_of(folder, WRITTEN_ON_LOADING) if whole else hash_of(artifact_path(folder, ESTIMATOR_ARTIFACT))
    expected = {version.tags.get(key, "unknown"), logged.tags.get(key, "unknown")}
    if expected != {found}:
        stated = ", ".join(f"{each[:12]}…" for each in sorted(expected))
        raise _BrokenLinkError(f"their hash is {found[:12]}…, but the version was made of {stated}")
    return f"content {found[:12]}…"


def _is_compiled_source(path: Path) -> bool:
    """Return whether bytecode is what this Python makes of its source, as loading a model leaves it behind."""
    try:
        source, content = Path(source_from_cache(str(path))), path.read_bytes()
        compiled = compile(source.read_bytes(), str(source), "exec", dont_inherit=True)
        return content[:4] == MAGIC_NUMBER and bool(marshal.loads(content[16:]) == compiled)  # noqa: S302 - not run
    except Exception:  # whatever marshal makes of it
        return False


def _tags(origin: dict[str, Any], version: ModelVersion) -> str:
    """The tags that a browser shows and the file inside the model must agree."""
    if "gate" not in origin:
        raise _BrokenLinkError("there is no lineage.json to compare them with")
    differing = [key for key, value in tags_of(origin).items() if version.tags.get(key) != value]
    if differing:
        raise _BrokenLinkError(f"{', '.join(differing)} differ from the lineage.json inside the model")
    return "agree with the lineage.json inside the model"


def _gate(store: Store, version: ModelVersion) -> str:
    """The figures must lead to the decision that is stated, and be those of the run of ``register``."""
    tags = version.tags
    try:
        gate, incumbent = json.loads(tags[GATE]), json.loads(tags["gate_incumbent"])
        figures = None if incumbent is None else incumbent["errors_percent"]
        decision = decide(gate["errors_percent"], figures, gate["tolerance_percent"])
        stated = Decision(tags[DECISION] == "promoted", tags["gate_reason"])
    except (KeyError, ValueError, TypeError) as error:
        raise _BrokenLinkError(f"it left no decision that can be checked ({type(error).__name__}: {error})") from error
    if decision != stated and stated.reason != REFUSED_ROLLED_BACK:
        raise _BrokenLinkError(f"its figures lead to {decision.reason!r}, but it states {stated.reason!r}")
    query = f"attributes.run_name = 'register' and tags.{CANDIDATE_KEY} = '{tags.get(CANDIDATE_KEY)}'"
    figures = error_metrics(gate["errors_percent"])
    for run in store.client.search_runs([store.experiment_id], query):
        if figures.items() <= run.data.metrics.items() and run.data.tags.get("gate_reason") == stated.reason:
            return stated.reason
    raise _BrokenLinkError(f"no run of register in {store.uri} has its figures; run `cylinder-friction track`")


def _locked(root: Path, path: str, md5: str) -> str:
    where = _where_in_history(root, LOCK_FILE, lambda text: locked_hashes(text).get(path) == md5)
    if where is None:
        raise _BrokenLinkError(f"{md5} in no commit of {LOCK_FILE}")
    return f"{md5} in {where}"


def _data(root: Path, path: str, md5: str) -> str:
    lies, where = where_data_lies(root, path, md5)
    if not lies:
        raise _BrokenLinkError(where)
    return where


def _params(root: Path, origin: dict[str, Any]) -> str:
    if not origin:
        raise _BrokenLinkError("there is no lineage.json to read them from")
    expected = origin["params_sha256"]
    if json_hash(origin["params"]) != expected:
        raise _BrokenLinkError("those inside the model are not those it was registered with")
    where = _where_in_history(
        root, PARAMS_FILE, lambda text: json_hash(shaping_params(yaml.safe_load(text) or {})) == expected
    )
    if where is None:
        path = root / PARAMS_FILE
        now = shaping_params(yaml.safe_load(path.read_text(encoding="utf-8")) or {}) if path.is_file() else {}
        raise _BrokenLinkError(f"{_differences(origin['params'], now)}, and no commit has them as they were")
    return f"{expected[:12]}… in {where}"


def _where_in_history(root: Path, file: str, fits: Callable[[str], bool]) -> str | None:
    """Return where a version of ``file`` fits: the working tree, or the newest commit that changed it so."""
    path = root / file
    if path.is_file() and _fits(fits, path.read_bytes().decode(errors="replace")):
        return "the working tree"
    for sha in (git(root, "log", "--all", "--format=%H", "--", file) or "").split():
        text = git(root, "show", f"{sha}:{file}")
        if text is not None and _fits(fits, text):
            return f"commit {sha[:12]}"
    return None


def _fits(fits: Callable[[str], bool], text: str) -> bool:
    try:
        return fits(text)
    except (TrackingError, yaml.YAMLError, ValueError, TypeError, AttributeError):
        return False  # a version with the marks of a merge, for example


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
