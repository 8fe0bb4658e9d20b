"""An exported hybrid in both versions, opened by a host."""

from collections.abc import Iterator

import pytest

from cylinder_friction.deployment.fmu.export import ExportedFmu, export_fmu
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.recordings.recording import Recording
from fmu_host import ExtractedFmu, FmuInstance
from learned_offset import learning_hybrid, offset_samples

__all__ = ["learning_hybrid", "offset_samples"]


@pytest.fixture(scope="session", params=["small_hybrid", "learning_hybrid"])
def hybrid(request: pytest.FixtureRequest) -> HybridEstimator:
    """A hybrid without and with a tracker of the sensors' offset."""
    chosen: HybridEstimator = request.getfixturevalue(request.param)
    return chosen


@pytest.fixture(scope="session")
def model(hybrid: HybridEstimator) -> StepModel:
    return hybrid.step_model()


@pytest.fixture(scope="session", params=[2, 3], ids=["fmi2", "fmi3"])
def exported(
    request: pytest.FixtureRequest, hybrid: HybridEstimator, tmp_path_factory: pytest.TempPathFactory
) -> ExportedFmu:
    """The FMU of a hybrid."""
    return export_fmu(hybrid, tmp_path_factory.mktemp("fmu") / "press.fmu", request.param)


@pytest.fixture(scope="session")
def opened(exported: ExportedFmu, tmp_path_factory: pytest.TempPathFactory) -> ExtractedFmu:
    if exported.binary is None:
        pytest.skip(exported.note)
    return ExtractedFmu(exported.path, tmp_path_factory.mktemp("fmu") / "unpacked")


@pytest.fixture
def instance(opened: ExtractedFmu) -> Iterator[FmuInstance]:
    """A new instance in the state: instantiated."""
    instance = opened.instance()
    yield instance
    instance.close()


@pytest.fixture(scope="session")
def samples(labelled_recordings: list[Recording]) -> list[tuple[float, float, float]]:
    """Three seconds of raw samples."""
    return [(float(p1), float(p2), float(x)) for p1, p2, x in labelled_recordings[0].samples()[:600]]
