"""Fixtures that many tests share."""

import json
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.dvc_hashes import dvc_hash
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.import_graph import remove_stale_machine_code
from cylinder_friction.labelling.offset_identification import fit_offset_model
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.recordings.recording import Recording, SensorUncertainty
from cylinder_friction.recordings.storage import write_recording
from cylinder_friction.run_record import Dataset, RunRecord

pytest_plugins = ("browser", "made_recordings", "small_hybrid")
PIPELINE = "tests/pipeline/"


def pytest_configure(config: pytest.Config) -> None:
    if not hasattr(config, "workerinput"):
        remove_stale_machine_code()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with what takes longest: given out last, it would keep one worker busy long after the others."""
    items.sort(key=lambda item: not item.nodeid.startswith(PIPELINE))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Give each file to one worker, and all files of the pipeline to the same: they share one finished pipeline."""
    from xdist.scheduler import LoadFileScheduling

    config.option.loadscopereorder = False  # by the number of tests, which says little of their time

    class Scheduling(LoadFileScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return PIPELINE if nodeid.startswith(PIPELINE) else str(super()._split_scope(nodeid))

    return Scheduling(config, log)


@pytest.fixture(scope="session")
def offset_recordings(cylinder: Cylinder, labelled_recordings: list[Recording]) -> list[Recording]:
    """The same with sensors that have an offset in each session, which was identified from all of them."""
    stated = {name: SensorUncertainty(3000.0, 0.0, zeroed=True) for name in ("pressure_1_pa", "pressure_2_pa")}
    generator, measured = np.random.default_rng(4), []
    for recording in labelled_recordings:
        zero_pa = 3000.0 * generator.standard_normal()
        offset_n = cylinder.piston_area_m2 * zero_pa
        shifted = recording.with_columns(
            pressure_1_pa=recording.column("pressure_1_pa") + zero_pa,
            friction_n=recording.column("friction_n") + offset_n,
            friction_uncertainty_n=np.full(len(recording), 26.0),
        )
        measured.append(replace(shifted, metadata=replace(recording.metadata, uncertainty=stated)))
    return fit_offset_model(measured, cylinder).corrected(measured)


@pytest.fixture(scope="session")
def small_model(small_hybrid: HybridEstimator) -> StepModel:
    return small_hybrid.step_model()


@pytest.fixture(scope="session")
def empty_store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store with its schema and nothing in it; copying it spares every test the seconds of making one."""
    from mlflow import MlflowClient

    path = tmp_path_factory.mktemp("store") / "mlflow.db"
    MlflowClient(f"sqlite:///{path}").search_experiments()
    return path


@pytest.fixture(scope="session")
def written_pipeline(
    tmp_path_factory: pytest.TempPathFactory,
    small_hybrid: HybridEstimator,
    labelled_recordings: list[Recording],
    empty_store: Path,
) -> Path:
    """A repository as the pipeline leaves it before ``register``: recordings, model, report, run records, dvc.lock.

    Read only: a test that changes something copies it. Its store is its own, whatever MLFLOW_TRACKING_URI says.
    """
    root = tmp_path_factory.mktemp("pipeline")
    shutil.copy(empty_store, root / "mlflow.db")
    raw = root / "data/raw/rig"
    raw.mkdir(parents=True)
    (raw / "log.csv").write_text("time,pressure\n0.0,10.5\n", encoding="utf-8")
    (root / "data/interim").mkdir()
    ingested = {"source": "data/raw/rig", "truth": "data/raw/rig_truth", "load": "none"}
    (root / "data/interim/ingested.json").write_text(json.dumps(ingested), encoding="utf-8")
    for role, chosen in (("train", 1), ("validation", 2), ("calibration", 2), ("test", 2)):
        for recording in labelled_recordings:
            if recording.name.endswith(str(chosen)):
                write_recording(root / "data/processed" / role, recording)
    small_hybrid.save(root / "models/hybrid")
    (root / "models/baselines").mkdir()
    (root / "models/hybrid/chosen.json").write_text('{"layers": 1, "nodes": 4}', encoding="utf-8")
    (root / "models/hybrid/training_data.json").write_text('{"train": {"a": "00", "b": "11"}}', encoding="utf-8")
    conditions = sorted({recording.metadata.condition for recording in labelled_recordings})
    numbers = {condition: {"label_percent": 2.0 + 0.1 * int(condition), "label_mae_n": 8.0} for condition in conditions}
    (root / "reports/figures").mkdir(parents=True)
    (root / "reports/figures/figure_5.png").write_bytes(_SMALLEST_PNG)
    (root / "reports/report.html").write_text("<h1>Comparison</h1>", encoding="utf-8")
    (root / "reports/metrics.json").write_text(json.dumps({"hybrid": numbers}), encoding="utf-8")
    (root / "reports/coverage.json").write_text("[]", encoding="utf-8")
    params = {"record": {"seed": 1}, "train": {"seed": 2}, "register": {"tolerance_percent": 0.1}}
    (root / "params.yaml").write_text(yaml.safe_dump(params), encoding="utf-8")
    folders = ["data/raw/rig", *(f"data/processed/{role}" for role in ("train", "validation", "calibration", "test"))]
    outs = [{"path": folder, "hash": "md5", "md5": dvc_hash(root / folder)} for folder in folders]
    (root / "dvc.lock").write_text(yaml.safe_dump({"schema": "2.0", "stages": {"all": {"outs": outs}}}), "utf-8")
    _write_run_records(root)
    (root / ".gitignore").write_text(
        "/data\n/models\n/reports\n/mlflow.db*\n/mlartifacts\n/.cylinder-friction\n", "utf-8"
    )
    for command in (["init", "-q"], ["add", "-A"], [*_AUTHOR, "commit", "-q", "-m", "Pipeline"]):
        subprocess.run(["git", "-C", str(root), *command], check=True, capture_output=True)
    return root


def _write_run_records(root: Path) -> None:
    trials = tuple(
        RunRecord(f"trial {number}", {"layers": number}, {"validation_mae_n": 9.0 - number}, {"mae": [9.0, 8.5]})
        for number in range(3)
    )
    records = (
        RunRecord("record", {"seed": 1}, {"recordings": 8.0}),
        RunRecord("search", {"trials": 3}, {"best_mae_n": 6.0}, children=trials),
        RunRecord(
            "train",
            {"seed": 2},
            {"mae_n": 8.0},
            {"mae": [9.0, 8.0]},
            artifacts=("models/hybrid",),
            datasets={"train": Dataset("data/processed/train", "0" * 32, {"friction_n": "double"}, 1)},
        ),
        RunRecord(
            "compare",
            {"main": "hybrid"},
            {"label_error_percent/condition_1": 2.1},
            artifacts=("reports/report.html", "reports/figures/figure_5.png"),
            datasets={"test": Dataset("data/processed/test", "1" * 32, {"friction_n": "double"}, 2)},
            pipeline={"recipe": "default", "seed": "2", "changes": "none"},
        ),
    )
    (root / "reports/runs").mkdir()
    (root / "src").mkdir()
    (root / "src/train.py").write_text("NAME = 'train'\n", encoding="utf-8")
    for record in records:
        (root / f"reports/runs/{record.name}.json").write_text(json.dumps(record.to_dict()), encoding="utf-8")


_AUTHOR = ("-c", "user.name=Tester", "-c", "user.email=tester@localhost")
_SMALLEST_PNG = bytes.fromhex(
    "89504e470d0a1a0a0000000d49484452000000010000000108020000009077"
    "53de0000000c49444154789c63606060000000040001f61738550000000049454e44ae426082"
)
