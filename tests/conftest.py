"""Fixtures that many tests share: the cylinder, and labelled recordings whose friction is known in closed form."""

import json
import shutil
import subprocess
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import yaml
from playwright.sync_api import Page

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.dvc_hashes import dvc_hash
from cylinder_friction.estimators.forest import ForestPlan
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.training_plan import Architecture, TrainingPlan
from cylinder_friction.import_graph import remove_stale_machine_code
from cylinder_friction.labelling.offset_identification import fit_offset_model
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.recordings.recording import Recording, RecordingMetadata, SensorUncertainty
from cylinder_friction.recordings.storage import write_recording
from cylinder_friction.run_record import Dataset, RunRecord

SAMPLE_TIME_S = 0.005
PIPELINE = "tests/pipeline/"
LONGEST = (PIPELINE, "tests/test_wheel.py")


def pytest_configure(config: pytest.Config) -> None:
    if not hasattr(config, "workerinput"):
        remove_stale_machine_code()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with what takes longest: given out last, it would keep one worker busy long after the others."""
    items.sort(key=lambda item: not item.nodeid.startswith(LONGEST))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Give each file to one worker, and all files of the pipeline to the same: they share one finished pipeline."""
    from xdist.scheduler import LoadFileScheduling

    config.option.loadscopereorder = False  # by the number of tests, which says little of their time

    class Scheduling(LoadFileScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return PIPELINE if nodeid.startswith(PIPELINE) else str(super()._split_scope(nodeid))

    return Scheduling(config, log)


def made_recording(
    cylinder: Cylinder,
    name: str = "made",
    condition: str = "1",
    session: str = "s1",
    seed: int = 0,
    seconds: float = 20.0,
) -> Recording:
    """Return a labelled recording of a wandering sine with Stribeck friction and sensor noise; not from the rig."""
    generator = np.random.default_rng(seed)
    time_s = SAMPLE_TIME_S * np.arange(round(seconds / SAMPLE_TIME_S))
    rate = 2.0 * np.pi * generator.uniform(0.2, 0.5)
    amplitude_m = 0.03
    position_m = 0.125 + amplitude_m * np.sin(rate * time_s + seed)
    velocity_m_s = amplitude_m * rate * np.cos(rate * time_s + seed)
    acceleration_m_s2 = -amplitude_m * rate**2 * np.sin(rate * time_s + seed)
    pressure_2_pa = 9e5 * int(condition) + 2e5 * np.sin(0.3 * time_s)
    coulomb_n = 240.0 + 4.0 * (pressure_2_pa / 1e5)
    friction_n = (
        np.tanh(velocity_m_s / 2e-3) * (coulomb_n * (1.0 + 0.5 * np.exp(-((velocity_m_s / 8e-3) ** 2))))
        + 1500.0 * velocity_m_s
    )
    pressure_1_pa = (
        friction_n + pressure_2_pa * cylinder.annulus_area_m2 + cylinder.moving_mass_kg * acceleration_m_s2
    ) / cylinder.piston_area_m2
    table = pd.DataFrame(
        {
            "time_s": time_s,
            "pressure_1_pa": pressure_1_pa + generator.normal(0.0, 5e3, len(time_s)),
            "pressure_2_pa": pressure_2_pa + generator.normal(0.0, 5e3, len(time_s)),
            "position_m": position_m + generator.normal(0.0, 3e-5, len(time_s)),
            "velocity_m_s": velocity_m_s,
            "acceleration_m_s2": acceleration_m_s2,
            "friction_n": friction_n,
            "usable": np.ones(len(time_s), dtype=bool),
        }
    )
    return Recording(RecordingMetadata(name, condition, session, SAMPLE_TIME_S, cylinder.name), table)


@pytest.fixture(scope="session")
def cylinder() -> Cylinder:
    return Cylinder(
        name="Bosch H160CA 63x28", bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0
    )


def take_of_each_condition(cylinder: Cylinder, takes: tuple[int, ...]) -> list[Recording]:
    """Return recordings of each of the four tests, one session each."""
    return [
        made_recording(
            cylinder,
            f"condition{condition}_session{take}",
            str(condition),
            f"test{condition}-{take}",
            10 * condition + take,
        )
        for condition in (1, 2, 3, 4)
        for take in takes
    ]


@pytest.fixture(scope="session")
def labelled_recordings(cylinder: Cylinder) -> list[Recording]:
    """Two recordings of each of the four tests, one session each."""
    return take_of_each_condition(cylinder, (1, 2))


@pytest.fixture(scope="session")
def twelve_recordings(cylinder: Cylinder, labelled_recordings: list[Recording]) -> list[Recording]:
    """The same with a third of each."""
    return [*labelled_recordings, *take_of_each_condition(cylinder, (3,))]


@pytest.fixture(scope="session")
def offset_recordings(cylinder: Cylinder, labelled_recordings: list[Recording]) -> list[Recording]:
    """The same with sensors that have an offset in each session, which was identified from all of them."""
    stated = {name: SensorUncertainty(3000.0, 0.0) for name in ("pressure_1_pa", "pressure_2_pa")}
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
def small_hybrid(cylinder: Cylinder, labelled_recordings: list[Recording]) -> HybridEstimator:
    """A hybrid of both parts, trained for two epochs: everything a real one has, only bad at its task."""
    hybrid = HybridEstimator(
        cylinder,
        "force_balance",
        Architecture(1, 8, 0.0, 1e-3),
        TrainingPlan(2, 2, 200, 20, 4),
        ForestPlan(4, 5, 2000, 20),
    )
    hybrid.fit(labelled_recordings)
    return hybrid


@pytest.fixture(scope="session")
def small_model(small_hybrid: HybridEstimator) -> StepModel:
    return small_hybrid.step_model()


@pytest.fixture
def new_page() -> Iterator[Callable[..., Page]]:
    """Return what opens a page of the system's Chromium, of a width and a height; a page waits two minutes."""
    program = shutil.which("chromium")
    if program is None:
        pytest.skip("chromium is not installed")
    from playwright.sync_api import sync_playwright

    arguments = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking"]
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=arguments)

        def open_page(width: int = 1400, height: int = 900) -> Page:
            page = browser.new_page(viewport={"width": width, "height": height})
            page.set_default_timeout(120_000)
            return page

        yield open_page
        browser.close()


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
