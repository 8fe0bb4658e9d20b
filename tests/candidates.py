"""A candidate for the champion's place in a written pipeline, and what the registry holds then."""

import json
import shutil
from collections.abc import Sequence
from multiprocessing.synchronize import Barrier
from pathlib import Path

from mlflow import MlflowClient
from mlflow.entities import Run
from mlflow.entities.model_registry import ModelVersion
from mlflow.models import Model

from cylinder_friction.dvc_hashes import dvc_hash, hashes_in
from cylinder_friction.estimators.saved_folder import read_description, write_description
from cylinder_friction.evaluation.reported import error_metrics
from cylinder_friction.files.whole_files import read_yaml
from cylinder_friction.run_record import Dataset, RunRecord
from cylinder_friction.tracking import registry
from cylinder_friction.tracking.gate import Candidate
from cylinder_friction.tracking.lineage import shaping_params
from cylinder_friction.tracking.log_run import log_run
from cylinder_friction.tracking.registry import REGISTERED_FILE, register
from cylinder_friction.tracking.store import EXPERIMENT, tracking_uri

NAME = "friction-estimator"
PIPELINE = {"recipe": "default", "seed": "2", "changes": "none"}


_MEASURED: dict[str, dict[str, float]] = {}  # What a model of that hash would be measured to have


def candidate_in(root: Path, errors: dict[str, float] | None = None, tolerance_percent: float = 0.1) -> Candidate:
    folders = ("data/raw/rig", *(f"data/processed/{role}" for role in ("train", "validation", "test")))
    candidate = Candidate(
        NAME,
        "models/hybrid",
        dvc_hash(root / "models/hybrid"),
        errors or {"1": 2.0, "2": 2.0},
        "label",
        tolerance_percent,
        {folder: hashes_in(root)[folder] for folder in folders},
        shaping_params(read_yaml(root / "params.yaml")),
        {"pressure_1_pa": [1e6, 1.1e6], "pressure_2_pa": [9e5, 9e5], "position_m": [0.12, 0.121]},
        PIPELINE,
    )
    _MEASURED[candidate.model_md5] = candidate.errors_percent
    return candidate


def measured(folder: Path) -> dict[str, float]:
    """Return the errors that the model in ``folder`` had as a candidate."""
    return _MEASURED[dvc_hash(folder)]


def registered_in(root: Path, errors: dict[str, float] | None = None, tolerance_percent: float = 0.1) -> Candidate:
    """Register the model that lies there as the stage does: its file, its record and its run included."""
    candidate = candidate_in(root, errors, tolerance_percent)
    registered = register(candidate, root, measured)
    (root / REGISTERED_FILE).write_text(json.dumps(registered.to_dict()), encoding="utf-8")
    record = RunRecord(
        "register",
        {"tolerance_percent": tolerance_percent},
        metrics=error_metrics(candidate.errors_percent, "label"),
        artifacts=(REGISTERED_FILE.as_posix(),),
        datasets={"test": Dataset("data/processed/test", dvc_hash(root / "data/processed/test"), {}, 2)},
        pipeline=PIPELINE,
    )
    (root / "reports/runs/register.json").write_text(json.dumps(record.to_dict()), encoding="utf-8")
    log_run(record, root)
    return registered


def register_together(root: Path, errors_of: dict[str, dict[str, float]], barrier: Barrier) -> None:
    """Register the model that lies there at the same moment as others do; errors are by the hash of a model."""
    _MEASURED.update(errors_of)
    candidate = candidate_in(root, errors_of[dvc_hash(root / "models/hybrid")])
    barrier.wait()
    register(candidate, root, measured)


def race(roots: Sequence[Path], errors_of: dict[str, dict[str, float]], barrier: Barrier) -> None:
    """Register the model of each repository in turn; others, which register at the same moment, meet at the barrier.

    The models cannot be served, so that a round takes no second of computing.
    """
    registry.save_model_folder = _save_estimator_alone
    for root in roots:
        register_together(root, errors_of, barrier)
        barrier.wait()  # whoever looks between two rounds finds both decided
        barrier.wait()


def _save_estimator_alone(path: Path, estimator: Path, *about: object) -> None:
    model = about[-1]
    assert isinstance(model, Model)
    shutil.copytree(estimator, path / "estimator")
    model.add_flavor("python_function", artifacts={"estimator": {"path": "estimator"}})
    model.save(path / "MLmodel")


def other_model(root: Path) -> None:
    """Make the candidate's folder another model, which works as well."""
    folder = root / "models/hybrid"
    content = read_description(folder)
    content["parameters"]["target_mean_n"] += 1.0
    write_description(folder, content, ["network.onnx", "forest.onnx"])


def runs_in(root: Path, condition: str = "", experiment_name: str = EXPERIMENT) -> list[Run]:
    client = MlflowClient(tracking_uri(root))
    experiment = client.get_experiment_by_name(experiment_name)
    assert experiment is not None
    return list(client.search_runs([experiment.experiment_id], condition))


def versions(root: Path) -> list[ModelVersion]:
    client = MlflowClient(tracking_uri(root))
    found = client.search_model_versions(f"name = '{NAME}'")
    return sorted((client.get_model_version(NAME, one.version) for one in found), key=lambda one: int(one.version))


def champion(root: Path) -> str:
    return str(MlflowClient(tracking_uri(root)).get_model_version_by_alias(NAME, "champion").version)
