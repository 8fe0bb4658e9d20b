"""The model registry: a candidate becomes a version once, and the champion only if the gate lets it."""

import getpass
import json
import logging
import re
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from datetime import UTC, datetime
from pathlib import Path

from mlflow.entities.model_registry import ModelVersion
from mlflow.exceptions import MlflowException

from cylinder_friction.tracking.gate import Candidate, Decision, Errors, Incumbent, Registered, decide
from cylinder_friction.tracking.model_folder import ESTIMATOR_ARTIFACT, artifact_path, download_model
from cylinder_friction.tracking.model_version import (
    ABANDONED,
    DECISION,
    LINEAGE,
    MODEL_KEY,
    ensure_version,
    find_version,
)
from cylinder_friction.tracking.repository import LineageError, TrackingError
from cylinder_friction.tracking.store import Store, open_store

ALIAS = "champion"
REGISTERED_FILE = Path("models/registered.json")
_INCUMBENT = "gate_incumbent"
_REASON = "gate_reason"
ROLLED_BACK = "rolled_back"
PROMOTED = "promoted"
_PATIENCE_S = 120.0
_POLL_S = 0.5
REFUSED_ROLLED_BACK = (
    "refused: this model was champion and was rolled back; `cylinder-friction rollback --to` promotes it"
)

_DESCRIPTION = """**{reason}**

{card}

**Where it came from**

| | |
|---|---|
| code | commit {commit} |{data}

`cylinder-friction lineage {uri}` checks every link.
"""

_log = logging.getLogger(__name__)


def register(
    candidate: Candidate, root: Path, measure: Callable[[Path], Errors], patience_s: float = _PATIENCE_S
) -> Registered:
    """Make the candidate a version of the registered model and, if the gate lets it, the champion.

    A refused candidate becomes a version too, without the alias: the registry then shows what was tried and why it
    was refused. Whatever moment a kill comes at, calling it again ends in the same state: a candidate is recognised
    by its content, a half-logged one is deleted, and the alias moves in one step. A candidate is decided once, and a
    model that a person rolled back is not promoted again.

    Machines that share a server decide one after the other, in the order of their version numbers, which the server
    gives out once each: a version waits until all before it are decided.

    ``measure`` returns the errors of the estimator saved in a folder on the present held-out recordings: the champion's
    figures are measured, not read from the registry. An earlier version, whose machine may have stopped, is waited for
    ``patience_s``.

    Raises:
        TrackingError: The registry cannot be reached, the candidate's folder is not the one that was measured, or
            another machine went on without this one.
    """
    with open_store(root) as store:
        champion = champion_of(store, candidate.model_name)
        if champion is not None and champion.tags.get(MODEL_KEY) == candidate.model_key and DECISION in champion.tags:
            return _decided_before(candidate, champion)
        version = ensure_version(store, candidate, root)
        if DECISION in version.tags:
            decided = _decided_before(candidate, version)
            rolled_back = ROLLED_BACK in version.tags
            return replace(decided, promote=False, reason=REFUSED_ROLLED_BACK) if rolled_back else decided
        _wait_for_earlier(store, version, patience_s)
        return _decide(store, version, candidate, measure)


def _wait_for_earlier(store: Store, version: ModelVersion, patience_s: float) -> None:
    deadline, warned = time.monotonic() + patience_s, False
    while True:
        versions = _versions(store, version.name)
        earlier = [n for n, each in versions.items() if n < int(version.version) and DECISION not in each.tags]
        if not earlier:
            return
        if not warned:
            _log.warning(
                "%s version %s waits for version %d: it is being decided", version.name, version.version, min(earlier)
            )
            warned = True
        if time.monotonic() > deadline:
            for number in earlier:
                _tag(store, versions[number], {DECISION: ABANDONED})
        time.sleep(_POLL_S)


def _decide(store: Store, version: ModelVersion, candidate: Candidate, measure: Callable[[Path], Errors]) -> Registered:
    while True:
        champion = champion_of(store, version.name)
        if _same(champion, version):  # a kill came just after the alias had moved
            break
        incumbent = _incumbent(store, champion, measure)
        figures = None if incumbent is None else incumbent.errors_percent
        decision = decide(candidate.errors_percent, figures, candidate.tolerance_percent)
        if any(
            ROLLED_BACK in each.tags and each.tags.get(MODEL_KEY) == candidate.model_key
            for each in _versions(store, version.name).values()
        ):
            decision = Decision(False, REFUSED_ROLLED_BACK)
        _write_decision(store, version, Registered(candidate, ALIAS, decision.promote, decision.reason, incumbent))
        if _number(champion_of(store, version.name)) != _number(champion):
            continue  # a person moved the alias meanwhile
        if DECISION in _read_again(store, version).tags:
            raise TrackingError(
                f"{version.name} version {version.version}: its decision took so long that another machine went on "
                "without it, and nothing was promoted; run `dvc repro` again"
            )
        if decision.promote:
            _write_promotion(store, version, champion)
            store.client.set_registered_model_alias(version.name, ALIAS, version.version)
        break
    _tag(store, version, {DECISION: "promoted" if _same(champion_of(store, version.name), version) else "refused"})
    return _decided_before(candidate, _read_again(store, version))


def rollback(root: Path, name: str, to: int | None = None) -> str:
    """Make the previous champion, or the version ``to``, the champion; return in words what was done.

    It lasts: the version that is left is tagged, and the gate does not promote it again.

    Raises:
        LineageError: There is no such model or version, or no previous champion.
        TrackingError: The registry cannot be reached.
    """
    with open_store(root, create=False) as store:
        versions, champion = _versions(store, name), champion_of(store, name)
        if not versions:
            raise LineageError(f"{name}: the registry at {store.uri} has no version of it; expected a registered model")
        number = _previous(versions, champion) if to is None else to
        if number not in versions:
            there = ", ".join(str(each) for each in sorted(versions))
            what = "no previous champion is known" if to is None else f"there is no version {to}"
            raise LineageError(f"{name}: {what}; name one of its versions with --to: {there}")
        target = versions[number]
        if _same(champion, target):
            return f"{name} version {number} is the champion already"
        before = _words(champion)
        by = _by_whom()
        store.client.set_registered_model_tag(name, ROLLED_BACK, f"{before} to version {number} {by}")
        if champion is not None and number < int(champion.version):
            _tag(store, champion, {ROLLED_BACK: f"to version {number} {by}"})
        if ROLLED_BACK in target.tags:
            store.client.delete_model_version_tag(name, target.version, ROLLED_BACK)
        if number > _number(champion):
            _write_promotion(store, target, champion)
        store.client.set_registered_model_alias(name, ALIAS, target.version)
    return f"{name}: champion was {before}, is version {number}"


def _previous(versions: Mapping[int, ModelVersion], champion: ModelVersion | None) -> int:
    """Return the number of the champion before; 0 where nothing states it."""
    number, seen = _number(champion), set[int]()
    while number not in seen:
        seen.add(number)
        tags = versions[number].tags if number in versions else {}
        before = re.match(r"from version (\d+) ", tags.get(PROMOTED, ""))
        number = int(before[1]) if before else 0
        if number in versions and ROLLED_BACK not in versions[number].tags:
            return number
    return 0


def recorded_version(store: Store, registered: Registered, root: Path, *, make: bool) -> str:
    """Return in words which version a registration came to; ``make`` it where it is not there, but never champion.

    Raises:
        TrackingError: The model's folder is missing or not the registered one.
    """
    candidate = registered.candidate
    found = find_version(store, candidate)
    if make and found is None:
        found = ensure_version(store, candidate, root, {DECISION: "promoted" if registered.promote else "refused"})
        _write_decision(store, found, registered)
    if found is None:
        return f"{candidate.model_name} has no version of {candidate.folder}: it was removed from the registry"
    command = f"`cylinder-friction rollback {found.name} --to {found.version}` makes it {ALIAS}"
    role = ALIAS if _same(champion_of(store, found.name), found) else f"not {ALIAS}; {command}"
    return f"{found.name} version {found.version} ({role})"


def champion_of(store: Store, model_name: str) -> ModelVersion | None:
    """Return the version in use, if there is one."""
    if not store.client.search_registered_models(f"name = '{model_name}'"):
        return None  # a server with logins refuses (403) to look for an alias of what is not there
    try:
        return store.client.get_model_version_by_alias(model_name, ALIAS)
    except MlflowException as error:
        if error.error_code in ("RESOURCE_DOES_NOT_EXIST", "INVALID_PARAMETER_VALUE"):
            return None
        raise


def _versions(store: Store, name: str) -> dict[int, ModelVersion]:
    return {int(each.version): each for each in store.client.search_model_versions(f"name = '{name}'")}


def _number(version: ModelVersion | None) -> int:
    return 0 if version is None else int(version.version)


def _same(champion: ModelVersion | None, version: ModelVersion) -> bool:
    return _number(champion) == int(version.version)


def _incumbent(store: Store, champion: ModelVersion | None, measure: Callable[[Path], Errors]) -> Incumbent | None:
    """Return the champion's figures on the present recordings."""
    if champion is None:
        return None
    with tempfile.TemporaryDirectory() as scratch:
        folder = download_model(store, champion, Path(scratch))
        return Incumbent(champion.tags.get(MODEL_KEY, "unknown"), measure(artifact_path(folder, ESTIMATOR_ARTIFACT)))


def _decided_before(candidate: Candidate, version: ModelVersion) -> Registered:
    """Return the decision that stands in the registry."""
    stored = json.loads(version.tags[_INCUMBENT])
    incumbent = None if stored is None else Incumbent(**stored)
    return Registered(candidate, ALIAS, version.tags[DECISION] == "promoted", version.tags[_REASON], incumbent)


def _write_decision(store: Store, version: ModelVersion, registered: Registered) -> None:
    """Write on what grounds the gate decided."""
    incumbent = None if registered.incumbent is None else asdict(registered.incumbent)
    _tag(store, version, {_INCUMBENT: json.dumps(incumbent), _REASON: registered.reason})
    origin = json.loads(version.tags[LINEAGE])
    description = _DESCRIPTION.format(
        reason=registered.reason[0].upper() + registered.reason[1:],
        card=registered.candidate.card,
        commit=origin["git_commit"],
        data="".join(f"\n| `{path}` | {md5} |" for path, md5 in origin["data"].items()),
        uri=f"models:/{version.name}/{version.version}",
    )
    store.client.update_model_version(version.name, version.version, description)


def _write_promotion(store: Store, version: ModelVersion, before: ModelVersion | None) -> None:
    """Write down what MLflow keeps no history of."""
    _tag(store, version, {PROMOTED: f"from {_words(before)} {_by_whom()}"})


def _words(version: ModelVersion | None) -> str:
    return "none" if version is None else f"version {version.version}"


def _read_again(store: Store, version: ModelVersion) -> ModelVersion:
    return store.client.get_model_version(version.name, str(version.version))


def _tag(store: Store, version: ModelVersion, tags: Mapping[str, str]) -> None:
    for key, value in tags.items():
        store.client.set_model_version_tag(version.name, version.version, key, value)


def _by_whom() -> str:
    return f"by {getpass.getuser()} at {datetime.now(UTC).isoformat(timespec='seconds')}"
