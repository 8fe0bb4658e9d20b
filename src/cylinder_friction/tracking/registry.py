"""The model registry: make a candidate a version exactly once, and the champion only if the gate promotes it."""

import getpass
import json
import logging
import tempfile
import time
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

from mlflow.entities.model_registry import ModelVersion

from cylinder_friction.tracking.gate import Candidate, Errors, Incumbent, Registered, decide
from cylinder_friction.tracking.model_folder import download_model, saved_estimator
from cylinder_friction.tracking.model_version import DECISION, MODEL, PENDING, REASON, ensure_version, find_version
from cylinder_friction.tracking.repository import LineageError, TrackingError
from cylinder_friction.tracking.store import Store, open_store

ALIAS = "champion"
REGISTERED_FILE = Path("models/registered.json")
ABANDONED = "abandoned"
"""Value of ``DECISION`` if a version's machine stopped before the decision; the candidate may be registered again."""
ROLLED_BACK, PROMOTED = "rolled_back", "promoted"
_GATE = "gate"  # Tag: tolerance and incumbent of the decision, as JSON
_PATIENCE_S, _POLL_S = 120.0, 0.5
REFUSED_ROLLED_BACK = "refused: this model was champion and was rolled back; `cylinder-friction promote` promotes it"
ALREADY = "promoted: this model is the champion already"

_log = logging.getLogger(__name__)


def register(candidate: Candidate, root: Path, measure: Callable[[Path], Errors]) -> Registered:
    """Make the candidate a version of the registered model and, if the gate promotes it, the champion.

    A refused candidate also becomes a version, without the alias, so the registry shows what was tried and why it was
    refused. The gate decides once per candidate and tolerance. It does not promote a model that a person rolled back.
    After a kill at any moment, another call ends in the same state.

    Machines that share a server decide one after the other, in the order of the version numbers, of which the server
    issues each once. A version waits until all earlier versions are decided, for at most two minutes.

    ``measure`` returns the errors of the estimator saved in a folder on the current held-out recordings. The champion's
    errors are thus measured again, not read from the registry.

    Raises:
        TrackingError: The registry cannot be reached, the candidate's folder has changed since its errors were
            measured, the champion's files are missing, or the champion changed while the gate decided.
    """
    with open_store(root) as store:
        number, same = champion_number(store, candidate.model_name), _versions_of(store, candidate)
        if number in same:
            if lost := lost_files(store, same[number]):
                raise TrackingError(f"{candidate.model_name} version {number} ({ALIAS}): {lost}")
            _tag(store, same[number], {DECISION: "promoted"})  # a kill may have come just after the alias moved
            champion = _versions(store, candidate.model_name)[number]
            return _decided_before(candidate, champion) or Registered(candidate, True, ALREADY, None)
        if any(ROLLED_BACK in each.tags for each in same.values()):
            return Registered(candidate, False, REFUSED_ROLLED_BACK, None)
        version = ensure_version(store, candidate, root)
        if decided := _decided_before(candidate, version):
            return decided
        _tag(store, version, {DECISION: PENDING})  # it may have been decided at another tolerance, or abandoned
        _wait_for_earlier(store, version, _PATIENCE_S)
        return _decide(store, version, candidate, measure)


def _wait_for_earlier(store: Store, version: ModelVersion, patience_s: float) -> None:
    deadline, waiting = time.monotonic() + patience_s, False
    while earlier := [
        each
        for number, each in sorted(_versions(store, version.name).items())
        if number < int(version.version) and each.tags.get(DECISION) == PENDING
    ]:
        if not waiting:
            words = "%s version %s waits for version %s: it is being decided"
            _log.warning(words, version.name, version.version, earlier[0].version)
        waiting = True
        if time.monotonic() > deadline:
            for each in earlier:
                _tag(store, each, {DECISION: ABANDONED})
        time.sleep(_POLL_S)


def _decide(store: Store, version: ModelVersion, candidate: Candidate, measure: Callable[[Path], Errors]) -> Registered:
    name, number = version.name, champion_number(store, version.name)
    incumbent = _measured(store, _versions(store, name)[number], measure) if number else None
    errors = None if incumbent is None else incumbent.errors_percent
    registered = Registered(
        candidate, *decide(candidate.errors_percent, errors, candidate.tolerance_percent), incumbent
    )
    _write_decision(store, version, registered)
    now = _versions(store, name)[int(version.version)]
    if champion_number(store, name) != number or now.tags[DECISION] != PENDING:
        raise TrackingError(
            f"{name} version {version.version}: the champion changed while the gate decided, or another machine went "
            "on without this one; nothing was promoted; run `dvc repro` again"
        )
    if registered.promote:
        before = f"version {number}" if number else "none"
        _tag(store, version, {PROMOTED: f"from {before} {_by_whom()}"})
        store.client.set_registered_model_alias(name, ALIAS, version.version)
    _tag(store, version, {DECISION: "promoted" if registered.promote else "refused"})
    return registered


def _measured(store: Store, champion: ModelVersion, measure: Callable[[Path], Errors]) -> Incumbent:
    """Measure the champion on the current held-out recordings."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = download_model(store, champion, Path(scratch))
        return Incumbent(champion.tags.get(MODEL, "unknown"), measure(saved_estimator(folder)))


def _decided_before(candidate: Candidate, version: ModelVersion) -> Registered | None:
    """Read the registry's decision on a version; None if there is none at this tolerance."""
    gate, decision = json.loads(version.tags.get(_GATE, "{}")), version.tags.get(DECISION)
    if decision not in ("promoted", "refused") or gate.get("tolerance_percent") != candidate.tolerance_percent:
        return None
    incumbent = None if gate["incumbent"] is None else Incumbent(**gate["incumbent"])
    return Registered(candidate, decision == "promoted", version.tags[REASON], incumbent)


def _write_decision(store: Store, version: ModelVersion, registered: Registered) -> None:
    """Write the grounds of the gate's decision to the registry."""
    candidate, reason = registered.candidate, registered.reason
    gate = {"tolerance_percent": candidate.tolerance_percent, "incumbent": registered.to_dict()["incumbent"]}
    _tag(store, version, {REASON: reason, _GATE: json.dumps(gate)})
    way_back = f"`cylinder-friction lineage models:/{version.name}/{version.version}` checks it."
    about = "\n\n".join([f"**{reason[0].upper()}{reason[1:]}**", candidate.card, way_back])
    store.client.update_model_version(version.name, version.version, about)


def move_champion(root: Path, name: str, to: int | None = None) -> str:
    """Make version ``to``, or without it the previous champion, the champion; return a sentence on what was done.

    The move is permanent: a newer version that was champion gets a tag, and the gate does not promote it again.

    Raises:
        LineageError: The model or version does not exist, or there is no previous champion.
        TrackingError: The registry cannot be reached.
    """
    with open_store(root, create=False, write=True) as store:
        versions, champion = _versions(store, name), champion_number(store, name)
        if not versions:
            raise LineageError(f"{name}: the registry at {store.uri} has no version of it; expected a registered model")
        served = [n for n, each in versions.items() if PROMOTED in each.tags and ROLLED_BACK not in each.tags]
        number = max((n for n in served if n < champion), default=0) if to is None else to
        if number not in versions:
            what = "no previous champion is known" if to is None else f"there is no version {to}"
            there = ", ".join(map(str, sorted(versions)))
            raise LineageError(
                f"{name}: {what}; name one of its versions, `cylinder-friction promote VERSION`: {there}"
            )
        if champion == number:
            return f"{name} version {number} is the champion already"
        before, by = f"version {champion}" if champion else "none", _by_whom()
        if number < champion:
            store.client.set_registered_model_tag(name, ROLLED_BACK, f"{before} to version {number} {by}")
            _tag(store, versions[champion], {ROLLED_BACK: f"to version {number} {by}"})
        else:
            _tag(store, versions[number], {PROMOTED: f"from {before} {by}"})
        if ROLLED_BACK in versions[number].tags:
            store.client.delete_model_version_tag(name, str(number), ROLLED_BACK)
        store.client.set_registered_model_alias(name, ALIAS, str(number))
    return f"{name}: champion was {before}, is version {number}"


def recorded_version(store: Store, registered: Registered, root: Path, *, make: bool) -> str:
    """Describe in words the version of a registration; if it is missing, ``make`` it, but never the champion.

    Raises:
        TrackingError: The model's folder is missing or differs from the registered one.
    """
    candidate, name = registered.candidate, registered.candidate.model_name
    found = find_version(store, candidate) or next(iter(_versions_of(store, candidate).values()), None)
    if make and (found is None or found.tags.get(DECISION) == PENDING):
        found = ensure_version(store, candidate, root)
        _write_decision(store, found, registered)
        _tag(store, found, {DECISION: "promoted" if registered.promote else "refused"})
    if found is None:
        return f"{name} has no version of {candidate.folder}: it was removed from the registry"
    command = f"`cylinder-friction promote {found.version} {name}` makes it {ALIAS}"
    role = ALIAS if champion_number(store, name) == int(found.version) else f"not {ALIAS}; {command}"
    lost = lost_files(store, found)
    return f"{name} version {found.version} ({role})" + (f": {lost}" if lost else "")


def lost_files(store: Store, version: ModelVersion) -> str:
    """Describe how to restore a version's files if they are missing; empty if they exist."""
    if store.client.list_logged_model_artifacts(str(version.source).removeprefix("models:/")):
        return ""
    return (
        f"its files are not at {store.client.get_model_version_download_uri(version.name, version.version)}; restore "
        "them from a backup, or delete the version and run `cylinder-friction track`, which makes it anew from the "
        "model's folder"
    )


def champion_number(store: Store, name: str) -> int:
    """Look up the number of the version in use; 0 if there is none."""
    found = store.client.search_registered_models(f"name = '{name}'")
    return int(found[0].aliases.get(ALIAS, 0)) if found else 0


def _versions(store: Store, name: str) -> dict[int, ModelVersion]:
    return {int(each.version): each for each in store.client.search_model_versions(f"name = '{name}'")}


def _versions_of(store: Store, candidate: Candidate) -> dict[int, ModelVersion]:
    """Look up all versions with the candidate's model, including versions measured on other recordings."""
    versions = _versions(store, candidate.model_name).items()
    return {number: each for number, each in versions if each.tags.get(MODEL) == candidate.model_md5}


def _tag(store: Store, version: ModelVersion, tags: dict[str, str]) -> None:
    for key, value in tags.items():
        store.client.set_model_version_tag(version.name, version.version, key, value)


def _by_whom() -> str:
    return f"by {getpass.getuser()} at {datetime.now(UTC).isoformat(timespec='seconds')}"
