"""The model registry: versions of candidates, the champion, and ``track``, which fills a store from files."""

import getpass
import json
import logging
import math
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path

import pandas as pd
from mlflow.entities import LoggedModelOutput, LoggedModelStatus, Metric
from mlflow.entities.model_registry import ModelVersion
from mlflow.exceptions import MlflowException
from mlflow.models import Model
from mlflow.utils.mlflow_tags import MLFLOW_MODEL_VERSIONS

from cylinder_friction.deployment.served_model import save_model_folder
from cylinder_friction.dvc_hashes import known_hash
from cylinder_friction.evaluation.reported import error_metrics
from cylinder_friction.execution.measuring import now_ms
from cylinder_friction.files.whole_files import hash_of, read_json
from cylinder_friction.run_record import RUNS_FOLDER, STAGES, RunRecord, records_in
from cylinder_friction.tracking.gate import Candidate, Errors, decide
from cylinder_friction.tracking.lineage import (
    FILES,
    LOST,
    REASON,
    REGISTER_AGAIN,
    WRITTEN_ON_LOADING,
    download_estimator,
    way_to_a_version,
)
from cylinder_friction.tracking.log_run import allowed, find_run, log_in, log_pipeline
from cylinder_friction.tracking.repository import TrackingError, commit_of
from cylinder_friction.tracking.store import Store, open_store
from cylinder_friction.wording import counted

ALIAS = "champion"
REGISTERED_FILE = Path("models/registered.json")
ALREADY = "promoted: this model is the champion already"
REFUSED_ROLLED_BACK = "refused: this model was champion and was rolled back; `cylinder-friction promote` promotes it"
# Tags of a version: first the tags for people, then hashes. While the gate decides, later versions wait.
_DECISION, _PENDING, _CANDIDATE, _MODEL = "decision", "pending", "hash_candidate", "hash_model"
_GATE, _PROMOTED, _ROLLED_BACK = "gate", "promoted", "rolled_back"
_ABOUT = "Friction inside a hydraulic cylinder [N] from two pressures and position."
_PATIENCE_S, _POLL_S = 120.0, 0.5

_log = logging.getLogger(__name__)


@dataclass
class Tracked:
    """Result of ``track``."""

    logged: list[str] = field(default_factory=list)  # Stages whose run was logged now
    present: list[str] = field(default_factory=list)  # Stages whose run already existed
    problems: list[str] = field(default_factory=list)  # Descriptions of records that could not be logged
    version: str = "no model is registered yet"  # Description of the registered version

    def summary(self) -> str:
        lines = [f"{counted(len(self.logged), 'run')} logged, {len(self.present)} already there", self.version]
        return "\n".join([*lines, *(f"not logged: {problem}" for problem in self.problems)])


def register(candidate: Candidate, root: Path, measure: Callable[[Path], Errors]) -> Candidate:
    """Make the candidate a version and, if the gate promotes it, the champion; return it with the gate's decision.

    A refused candidate also becomes a version, without the alias, so the registry shows what was tried and why it was
    refused. A model that is champion keeps its place; one that a person rolled back is refused. After a kill at any
    moment, another call ends in the same state.

    ``measure`` returns the errors of the estimator saved in a folder on the current held-out recordings. The champion's
    errors are thus measured again, not read from the registry.

    Raises:
        TrackingError: The registry cannot be reached, the candidate's folder has changed since its errors were
            measured, the champion's files are missing, an earlier version stays undecided, or the champion changed.
    """
    with open_store(root) as store, tempfile.TemporaryDirectory() as scratch:
        name, same = candidate.model_name, _versions(store, candidate.model_name, _MODEL, candidate.model_md5)
        if current := same.get(_champion(store, name)):
            if lost := _lost_files(store, current):
                raise TrackingError(f"{name} version {current.version} ({ALIAS}): {lost}")
            _tag(store, current, {_DECISION: "promoted"})  # a kill may have come just after the alias moved
            gate, reason = json.loads(current.tags.get(_GATE, "{}")), current.tags[REASON]
            if reason.startswith("promoted") and gate.get("tolerance_percent") == candidate.tolerance_percent:
                return replace(candidate, promote=True, reason=reason, incumbent=gate["incumbent"])
            return replace(candidate, promote=True, reason=ALREADY)
        if any(_ROLLED_BACK in each.tags for each in same.values()):
            return replace(candidate, reason=REFUSED_ROLLED_BACK)
        version = ensure_version(store, candidate, root)
        _tag(store, version, {_DECISION: _PENDING})  # it may have been decided before
        _wait_for_earlier(store, version)
        champion = _champion(store, name)
        saved = download_estimator(store, _versions(store, name)[champion], Path(scratch)) if champion else None
        errors = measure(saved) if saved else None
        promote, reason = decide(candidate.errors_percent, errors, candidate.tolerance_percent)
        decided = replace(candidate, promote=promote, reason=reason, incumbent=errors)
        _write_grounds(store, version, decided)
        if _champion(store, name) != champion:
            words = "the champion changed while the gate decided; nothing was promoted; run `dvc repro` again"
            raise TrackingError(f"{name} version {version.version}: {words}")
        if promote:
            _make_champion(store, version, champion)
        _tag(store, version, {_DECISION: "promoted" if promote else "refused"})
        return decided


def ensure_version(store: Store, candidate: Candidate, root: Path) -> ModelVersion:
    """Find the candidate's version of the registered model, or log the model with the pipeline's run and make it.

    Raises:
        TrackingError: The candidate's folder is missing or has changed since its errors were measured.
    """
    name, client, key, right = candidate.model_name, store.client, candidate.key(), candidate.model_md5
    if known := _versions(store, name, _CANDIDATE, key):
        return known[min(known)]
    folder, records = root / candidate.folder, records_in(root)
    found = known_hash(folder, root) if folder.is_dir() else ""
    if found != right:
        there = f"its hash is {found[:12]}…" if found else "it is not there"
        raise TrackingError(f"{folder}: {there}, but {right[:12]}… was measured; run `dvc checkout` or `dvc repro`")
    compared = replace(records.get("compare", RunRecord("compare")), pipeline=candidate.pipeline)
    trained = next((each for each in records.values() if candidate.folder in each.artifacts), RunRecord("train"))
    experiment, run_id = store.experiment(compared.experiment), log_pipeline(store, compared, root)
    for left in client.search_logged_models([experiment], filter_string=f"tags.`{_CANDIDATE}` = '{key}'"):
        client.delete_logged_model(left.model_id)  # of a kill
    commit, params = trained.commit or commit_of(root), {allowed(k): str(v) for k, v in trained.params.items()}
    model = client.create_logged_model(experiment, folder.name, run_id, {_CANDIDATE: key}, params)
    about = Model(model.artifact_location, run_id, model_uuid=model.model_id, model_id=model.model_id)
    origin = {"run_id": run_id, "recipe": candidate.pipeline["recipe"], "data": candidate.data}
    with tempfile.TemporaryDirectory() as scratch:
        written = Path(scratch) / "model"
        example = pd.DataFrame(candidate.example)
        save_model_folder(written, folder, {**origin, **commit, "params": candidate.params}, example, about)
        client.log_model_artifacts(model.model_id, str(written))
        files = hash_of(written, WRITTEN_ON_LOADING)
    client.log_outputs(run_id, [LoggedModelOutput(model.model_id, step=0)])
    test = compared.datasets.get("test")
    of = (model.model_id, "test", test.md5) if test else (model.model_id,)
    errors = error_metrics(candidate.errors_percent, candidate.reference)
    client.log_batch(run_id, [Metric(allowed(name), value, now_ms(), 0, *of) for name, value in errors.items()])
    client.finalize_logged_model(model.model_id, LoggedModelStatus.READY)
    with suppress(MlflowException):  # the registered model already exists
        client.create_registered_model(name, description=_ABOUT)
    mean, reference = errors.get(f"{candidate.reference}_error_percent/mean", math.nan), candidate.reference
    tags = {_DECISION: _PENDING, "error_percent": f"{mean:.3f} against {reference}", "recipe": origin["recipe"]}
    tags |= {"commit": commit["git_commit"], REASON: candidate.reason}
    tags |= {_CANDIDATE: key, _MODEL: right, FILES: files}
    version = client.create_model_version(name, f"models:/{model.model_id}", run_id, tags, model_id=model.model_id)
    shown = json.dumps([{"name": name, "version": str(version.version)}])
    client.set_logged_model_tags(model.model_id, {MLFLOW_MODEL_VERSIONS: shown})  # as `mlflow.register_model` does
    return version


def _wait_for_earlier(store: Store, version: ModelVersion) -> None:
    """Wait until earlier versions are decided: machines that share a server decide in the order of the numbers."""
    begun_s, number, waits = time.monotonic(), int(version.version), False
    while earlier := [n for n in _versions(store, version.name, _DECISION, _PENDING) if n < number]:
        words = f"{version.name} version {number} waits for version {earlier[0]}: it is being decided"
        if time.monotonic() > begun_s + _PATIENCE_S:
            raise TrackingError(f"{words}; if that was killed, run it again or delete version {earlier[0]}")
        if not waits:
            _log.warning(words)
        waits = True
        time.sleep(_POLL_S)


def _write_grounds(store: Store, version: ModelVersion, decided: Candidate) -> None:
    """Write the grounds of the gate's decision to the registry."""
    gate = {"tolerance_percent": decided.tolerance_percent, "incumbent": decided.to_dict()["incumbent"]}
    _tag(store, version, {REASON: decided.reason, _GATE: json.dumps(gate)})
    way_back = f"`cylinder-friction lineage models:/{version.name}/{version.version}` checks it."
    about = [f"**{decided.reason[0].upper()}{decided.reason[1:]}**", decided.card, way_back]
    store.client.update_model_version(version.name, version.version, "\n\n".join(about))


def track(root: Path) -> Tracked:
    """Log every ``reports/runs/<stage>.json`` that the store lacks.

    The run of ``register`` comes with its version, but never with the champion's alias: only ``register``, ``promote``
    and ``rollback`` move the alias. A version that a person deleted is not made again while that run exists.

    Raises:
        TrackingError: The store cannot be reached, or there is nothing to log.
    """
    paths, done = {path.stem: path for path in (root / RUNS_FOLDER).glob("*.json")}, Tracked()
    if not paths:
        raise TrackingError(f"{root / RUNS_FOLDER}: holds no run; run `dvc pull` or `dvc repro` first")
    with open_store(root) as store:
        for stage in sorted(paths, key=[*STAGES, *sorted(paths)].index):
            try:
                record = RunRecord.from_dict(read_json(paths[stage]))
                known = find_run(store, record) is not None
                if stage == "register" and (root / REGISTERED_FILE).is_file():
                    decided = Candidate.from_dict(read_json(root / REGISTERED_FILE))
                    done.version = f"registered model: {_recorded_version(store, decided, root, not known)}"
                log_in(store, record, root)
                (done.present if known else done.logged).append(stage)
            except (RuntimeError, ValueError, TypeError, AttributeError, OSError) as error:  # missing or cut-off file
                done.problems.append(f"{stage}.json: {error}")
    return done


def _recorded_version(store: Store, decided: Candidate, root: Path, make: bool) -> str:
    """Describe in words the version of a registration; if it is missing, ``make`` it, but never the champion."""
    name = decided.model_name
    same = _versions(store, name, _CANDIDATE, decided.key()) or _versions(store, name, _MODEL, decided.model_md5)
    found = next(iter(same.values()), None)
    if make and (found is None or found.tags[_DECISION] == _PENDING):
        found = ensure_version(store, decided, root)
        _write_grounds(store, found, decided)
        _tag(store, found, {_DECISION: "promoted" if decided.promote else "refused"})
    if found is None:
        gone = f"{name} has no version of {decided.folder}: it was removed from the registry"
        return f"{gone}; to have it again, run {REGISTER_AGAIN}"
    other = f"not {ALIAS}; `cylinder-friction promote {found.version} {name}` makes it {ALIAS}"
    words = f"{name} version {found.version} ({ALIAS if _champion(store, name) == int(found.version) else other})"
    return ": ".join(filter(None, [words, _lost_files(store, found)]))


def move_champion(root: Path, name: str, to: int | None = None) -> str:
    """Make version ``to``, or without it the previous champion, the champion; return a sentence on what was done.

    The move is permanent: a newer version that was champion gets a tag, and the gate does not promote it again.

    Raises:
        TrackingError: The registry cannot be reached, the model or version does not exist, its files are missing, or
            there is no previous champion.
    """
    with open_store(root, create=False) as store:
        found, champion = _versions(store, name), _champion(store, name)
        if not found:
            way = way_to_a_version(store, name)
            raise TrackingError(f"{name}: the registry at {store.uri} has no version of it; {way}")
        served = [n for n, each in found.items() if _PROMOTED in each.tags and _ROLLED_BACK not in each.tags]
        number = max((n for n in served if n < champion), default=0) if to is None else to
        if number not in found:
            what = "no previous champion is known" if to is None else f"there is no version {to}"
            way = f"name one of its versions, `cylinder-friction promote VERSION`: {', '.join(map(str, found))}"
            raise TrackingError(f"{name}: {what}; {way}")
        if lost := _lost_files(store, found[number]):
            raise TrackingError(f"{name} version {number}: {lost}")
        if champion == number:
            return f"{name} version {number} is the champion already"
        if number < champion:
            _tag(store, found[champion], {_ROLLED_BACK: f"to version {number} {_by_whom()}"})
        if _ROLLED_BACK in found[number].tags:
            store.client.delete_model_version_tag(name, str(number), _ROLLED_BACK)
        return f"{name}: champion was {_make_champion(store, found[number], champion)}, is version {number}"


def _make_champion(store: Store, version: ModelVersion, champion: int) -> str:
    """Move the alias to a version from the one with the number ``champion``, 0 for none; return the latter's name."""
    before = f"version {champion}" if champion else "none"
    if int(version.version) > champion:
        _tag(store, version, {_PROMOTED: f"from {before} {_by_whom()}"})
    store.client.set_registered_model_alias(version.name, ALIAS, version.version)
    return before


def _lost_files(store: Store, version: ModelVersion) -> str:
    """Describe how to restore a version's files if they are missing; empty if they exist."""
    if store.client.list_logged_model_artifacts(str(version.source).removeprefix("models:/")):
        return ""
    where = store.client.get_model_version_download_uri(version.name, version.version)
    return f"its files are not at {where}; {LOST}"


def _champion(store: Store, name: str) -> int:
    """Look up the number of the version in use; 0 if there is none."""
    found = store.client.search_registered_models(f"name = '{name}'")
    return int(found[0].aliases.get(ALIAS, 0)) if found else 0


def _versions(store: Store, name: str, tag: str = "", value: str = "") -> dict[int, ModelVersion]:
    """Look up the versions of a registered model by number, or only those with this value of a tag."""
    query = f"name = '{name}'" + (f" and tags.`{tag}` = '{value}'" if tag else "")
    found = store.client.search_model_versions(query)
    return {int(each.version): each for each in sorted(found, key=lambda each: int(each.version))}


def _tag(store: Store, version: ModelVersion, tags: dict[str, str]) -> None:
    for key, value in tags.items():
        store.client.set_model_version_tag(version.name, version.version, key, value)


def _by_whom() -> str:
    return f"by {getpass.getuser()} at {datetime.now(UTC).isoformat(timespec='seconds')}"
