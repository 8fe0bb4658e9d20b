"""A small hybrid's engine, samples for it, and services in this process."""

import subprocess
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any

import pytest

from cylinder_friction.arrays import Array
from cylinder_friction.estimators.forest import ForestPlan
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.training_plan import Architecture, TrainingPlan
from cylinder_friction.recordings.recording import Recording
from cylinder_friction_live.access import Access
from cylinder_friction_live.app import create_app
from cylinder_friction_live.engine import Engine
from cylinder_friction_live.engine_building import build_engine
from cylinder_friction_live.events import Events
from cylinder_friction_live.journal import Journal
from cylinder_friction_live.service import LiveService
from cylinder_friction_live.settings import LiveLimits
from live_process import PATIENT, Mosquitto, serving

pytest_plugins = ("browser", "made_recordings", "small_hybrid")


@pytest.fixture(scope="session")
def engine(small_hybrid: HybridEstimator, tmp_path_factory: pytest.TempPathFactory) -> Engine:
    return Engine(build_engine(small_hybrid, tmp_path_factory.mktemp("engine")))


@pytest.fixture(scope="session")
def other_estimator(small_hybrid: HybridEstimator, labelled_recordings: list[Recording]) -> HybridEstimator:
    """Another model for the same samples."""
    hybrid = HybridEstimator(
        small_hybrid.cylinder, "force_balance", Architecture(1, 4, 0.0, 1e-3), TrainingPlan(1, 1, 200, 20, 4),
        ForestPlan(2, 3, 2000, 20),
    )  # fmt: skip
    hybrid.fit(labelled_recordings)
    return hybrid


@pytest.fixture(scope="session")
def samples(labelled_recordings: list[Recording]) -> Array:
    return labelled_recordings[0].samples()


@pytest.fixture(scope="session")
def step_outputs(small_hybrid: HybridEstimator, samples: Array) -> tuple[Array, Array]:
    return small_hybrid.real_time().run(samples)


@pytest.fixture(scope="session")
def newtons(step_outputs: tuple[Array, Array]) -> Array:
    """Friction and bounds of the small hybrid's step for all samples; the first rows are those of the first samples."""
    return step_outputs[0]


@pytest.fixture(scope="session")
def flags(step_outputs: tuple[Array, Array]) -> Array:
    return step_outputs[1]


@pytest.fixture
def service(engine: Engine, tmp_path: Path) -> LiveService:
    return LiveService(engine, Journal(tmp_path / "journal.db"), limits=PATIENT)


@pytest.fixture(scope="session")
def model(small_hybrid: HybridEstimator, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("model") / "hybrid"
    small_hybrid.save(folder)
    return folder


@pytest.fixture
def golden(samples: Array, newtons: Array, flags: Array) -> dict[str, Any]:
    """The model's golden trajectory."""
    return {"samples": samples[:300].tolist(), "newtons": newtons[:300].tolist(), "flags": flags[:300].tolist()}


@pytest.fixture
def served(engine: Engine, tmp_path: Path) -> Iterator[Callable[..., str]]:
    """Start a service in a thread; return its address as ``HOST:PORT``."""
    with ExitStack() as running:

        def start(access: Access | None = None, limits: LiveLimits = PATIENT, log: Path | None = None) -> str:
            journal = running.enter_context(closing(Journal(tmp_path / "served.db")))
            service = LiveService(engine, journal, limits=limits)
            app = create_app(service, access=access, events=Events(log))
            return running.enter_context(serving(app, access=access))

        yield start


@pytest.fixture
def certificate(tmp_path: Path) -> tuple[Path, Path]:
    """A server's certificate for this machine, which signs itself, and its key."""
    certificate, key = tmp_path / "certificate.pem", tmp_path / "key.pem"
    made = ["req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=localhost", "-addext"]
    made += ["subjectAltName=IP:127.0.0.1,DNS:localhost", "-keyout", str(key), "-out", str(certificate)]
    subprocess.run(["openssl", *made], check=True, capture_output=True)
    return certificate, key


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[Mosquitto]:
    with Mosquitto(tmp_path) as started:
        yield started
