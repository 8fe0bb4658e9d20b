"""The model registry: a candidate becomes a version once, and the champion only if the gate lets it."""

import json
import tempfile
from collections.abc import Callable
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path

from mlflow.entities.model_registry import ModelVersion
from mlflow.exceptions import MlflowException

from cylinder_friction.tracking.gate import Candidate, Decision, Errors, Incumbent, Registered, decide
from cylinder_friction.tracking.model_folder import ESTIMATOR_ARTIFACT, artifact_path, download_model
from cylinder_friction.tracking.model_version import MODEL_KEY, ensure_version
from cylinder_friction.tracking.store import Store, open_store

ALIAS = "champion"
REGISTERED_FILE = "models/registered.json"

_TEST_DATA = "gate_test_data_md5"
_REFERENCE = "gate_reference"
_ERRORS = "gate_errors_percent"
_INCUMBENT = "gate_incumbent"
_REASON = "gate_reason"
_DECISION = "gate_decision"


def register(
    candidate: Candidate, root: Path, tolerance_percent: float, measure_again: Callable[[Path], Errors]
) -> Registered:
    """Make the candidate a version of the registered model and, if the gate lets it, the champion.

    A refused candidate becomes a version too, without the alias: the registry then shows what was tried and why it
    was refused. Whatever moment a kill comes at, calling it again ends in the same state: a model is recognised by
    its content, a half-logged one is deleted, and the alias moves last, in one step.

    Args:
        candidate: The trained estimator.
        root: The repository's root.
        tolerance_percent: Of the gate.
        measure_again: Returns the errors of the estimator saved in a folder on the present held-out recordings;
            called only where the champion was measured on other ones, or against another reference.

    Raises:
        TrackingError: The registry cannot be reached, or the candidate's folder is not the one that was measured.
    """
    with open_store(root) as store:
        version = ensure_version(store, candidate, root)
        champion = _champion(store, candidate.model_name)
        if _same(champion, version) and _DECISION in version.tags:
            return _decided_before(candidate, version, tolerance_percent)
        incumbent = _incumbent(store, champion, candidate, measure_again)
        decision = decide(
            candidate.errors_percent, None if incumbent is None else incumbent.errors_percent, tolerance_percent
        )
        result = Registered(candidate, ALIAS, decision.promote, decision.reason, tolerance_percent, incumbent)
        _write_decision(store, version, result)
        if decision.promote:
            _promote(store, version, champion)
        return result


def register_again(root: Path) -> str | None:
    """Bring the store in use to the state of ``models/registered.json``; return it in words, None without the file.

    The decision stands as it was made. The alias goes to the version only where it was promoted and nobody else has
    taken the place since.

    Raises:
        TrackingError: The store cannot be reached, or the model's folder is missing or not the registered one.
    """
    path = root / REGISTERED_FILE
    if not path.is_file():
        return None
    registered = Registered.from_dict(json.loads(path.read_text(encoding="utf-8")))
    candidate = registered.candidate
    with open_store(root) as store:
        version = ensure_version(store, candidate, root)
        if _DECISION not in version.tags:
            _write_decision(store, version, registered)
        champion = _champion(store, candidate.model_name)
        beaten = None if registered.incumbent is None else registered.incumbent.model_key
        if registered.promote and (champion is None or champion.tags.get(MODEL_KEY) == beaten):
            _promote(store, version, champion)
            champion = version
        role = f"{ALIAS}" if _same(champion, version) else f"not {ALIAS}"
    return f"{candidate.model_name} version {version.version} ({role})"


def _champion(store: Store, model_name: str) -> ModelVersion | None:
    try:
        return store.client.get_model_version_by_alias(model_name, ALIAS)
    except MlflowException as error:
        if error.error_code in ("RESOURCE_DOES_NOT_EXIST", "INVALID_PARAMETER_VALUE"):
            return None
        raise


def _same(champion: ModelVersion | None, version: ModelVersion) -> bool:
    return champion is not None and str(champion.version) == str(version.version)


def _incumbent(
    store: Store, champion: ModelVersion | None, candidate: Candidate, measure_again: Callable[[Path], Errors]
) -> Incumbent | None:
    """Return the champion's figures: its own where they were measured alike, else measured anew."""
    if champion is None:
        return None
    key = champion.tags.get(MODEL_KEY, "unknown")
    measured = (champion.tags.get(_TEST_DATA), champion.tags.get(_REFERENCE, "label"))
    if measured == (candidate.test_data_md5, candidate.reference):
        return Incumbent(key, json.loads(champion.tags[_ERRORS]))
    with tempfile.TemporaryDirectory() as scratch:
        folder = download_model(store, champion, Path(scratch))
        return Incumbent(key, measure_again(artifact_path(folder, ESTIMATOR_ARTIFACT)))


def _decided_before(candidate: Candidate, version: ModelVersion, tolerance_percent: float) -> Registered:
    """The candidate is the champion already: the decision that made it so stands."""
    stored = json.loads(version.tags[_INCUMBENT])
    decision = Decision(version.tags[_DECISION] == "promoted", version.tags[_REASON])
    incumbent = None if stored is None else Incumbent(**stored)
    return Registered(candidate, ALIAS, decision.promote, decision.reason, tolerance_percent, incumbent)


def _write_decision(store: Store, version: ModelVersion, registered: Registered) -> None:
    tags = {
        _ERRORS: json.dumps(registered.candidate.errors_percent, sort_keys=True),
        _TEST_DATA: registered.candidate.test_data_md5,
        _REFERENCE: registered.candidate.reference,
        "gate_tolerance_percent": str(registered.tolerance_percent),
        _INCUMBENT: json.dumps(None if registered.incumbent is None else asdict(registered.incumbent)),
        _REASON: registered.reason,
        _DECISION: "promoted" if registered.promote else "refused",
    }
    for key, value in tags.items():  # the decision itself last: where it stands, the rest stands
        store.client.set_model_version_tag(version.name, version.version, key, value)
    store.client.update_model_version(version.name, version.version, registered.reason)


def _promote(store: Store, version: ModelVersion, champion: ModelVersion | None) -> None:
    """Move the alias, last and in one step; tags record it, since MLflow keeps no history of aliases."""
    tags = {
        "promoted_from": "none" if champion is None else f"version {champion.version}",
        "promoted_to": f"version {version.version}",
        "promoted_at": datetime.now(UTC).isoformat(timespec="seconds"),
    }
    for key, value in tags.items():
        store.client.set_model_version_tag(version.name, version.version, key, value)
    store.client.set_registered_model_alias(version.name, ALIAS, version.version)
