"""An exported hybrid in both versions, opened by a host."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from cylinder_friction.deployment.fmu.export import ExportedFmu, export_fmu
from fmu_host import ExtractedFmu

if TYPE_CHECKING:
    from collections.abc import Iterator

    from cylinder_friction.estimators.hybrid import HybridEstimator
    from cylinder_friction.recordings.recording import Recording
    from fmu_host import FmuInstance


@pytest.fixture(scope="session", params=[2, 3], ids=["fmi2", "fmi3"])
def exported(
    request: pytest.FixtureRequest, small_hybrid: HybridEstimator, tmp_path_factory: pytest.TempPathFactory
) -> ExportedFmu:
    """The FMU of the small hybrid."""
    return export_fmu(small_hybrid, tmp_path_factory.mktemp("fmu") / "press.fmu", request.param)


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
