"""The Python API: the package's docstring runs as it stands, on logs as the rig's logger writes them."""

from __future__ import annotations

import doctest
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import cylinder_friction as cf
from cylinder_friction.rig.campaign import CampaignPlan, campaign

ROOT = Path(__file__).parents[1]
CYLINDER = cf.Cylinder(bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0)


@pytest.fixture(scope="module")
def checkout(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the rig's logs of a small campaign and the mapping that ships."""
    root = tmp_path_factory.mktemp("checkout")
    (root / "data/raw/rig").mkdir(parents=True)
    shutil.copytree(ROOT / "conf/ingest", root / "conf/ingest")
    plan = CampaignPlan(sessions_per_condition=3, recordings_per_session=1, duration_s=12.0)
    for recording in campaign(CYLINDER, plan):
        recording.logger.to_csv(root / f"data/raw/rig/{recording.metadata.name}.csv", index=False)
    return root


def test_the_example_of_the_package_runs(checkout: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(checkout)
    outcome = doctest.testmod(cf)
    assert outcome.attempted > 10
    assert outcome.failed == 0


def test_a_guessed_mapping_reads_the_same_numbers(checkout: Path) -> None:
    paths = sorted((checkout / "data/raw/rig").glob("*.csv"))[:2]
    mapped = cf.read_recordings(paths, channels=checkout / "conf/ingest/rig.yaml", cylinder=CYLINDER)
    with pytest.warns(UserWarning, match="guessed"):
        guessed = cf.read_recordings(paths, channels=None, cylinder=CYLINDER)
    for one, other in zip(mapped, guessed, strict=True):
        assert one.name == other.name
        assert np.allclose(one.samples(), other.samples())


def test_every_name_is_offered_and_an_unknown_one_is_refused() -> None:
    assert all(getattr(cf, name) is not None for name in cf.__all__)
    with pytest.raises(AttributeError, match="has no attribute 'Hybrid'; it offers Cylinder"):
        _ = cf.Hybrid


def test_importing_the_package_imports_no_library() -> None:
    code = "import cylinder_friction, sys; print(*sys.modules)"
    imported = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert not {"numpy", "pandas", "torch", "sklearn", "mlflow", "onnx"} & set(imported)
