"""A real crane's recordings rewritten as a TwinCAT Scope exports them; skipped where they are not there."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

DATA = Path(__file__).parents[3] / "../shared/data"

pytestmark = pytest.mark.skipif(not (DATA / "crane").is_dir(), reason="the crane's recordings are not here")


@pytest.fixture(scope="module")
def scope_export() -> Any:
    """What the command prints; tests call the same functions."""
    return import_module("scope_export")


@pytest.mark.parametrize("run", ["JibSineTest", "Dual2SineTest"])
def test_the_scopes_layout_gives_the_labels_of_the_present_files(scope_export: Any, run: str, tmp_path: Path) -> None:
    present, scope = scope_export.both_readings(DATA, run, tmp_path).values()
    assert len(present[0]) == len(scope[0]) == 1
    for column in ("time_s", "pressure_1_pa", "pressure_2_pa", "position_m", "friction_n", "velocity_m_s"):
        np.testing.assert_allclose(scope[0][0].column(column), present[0][0].column(column), rtol=1e-12, atol=1e-12)
    assert scope[1].load.coulomb_n == pytest.approx(present[1].load.coulomb_n, rel=1e-9)
    channels = yaml.safe_load((tmp_path / "ingest/crane.yaml").read_text(encoding="utf-8"))["channels"]
    assert channels["time_s"] == {"channel": "Name", "unit": "ms"}
    assert {name: entry["channel"] for name, entry in channels.items() if name != "time_s"} == {
        "pressure_1_pa": "jib_pA_cyl_bar",
        "pressure_2_pa": "jib_pB_cyl_bar",
        "position_m": "jib_x_m",
    }
