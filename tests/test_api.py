"""The Python API: the package's docstring runs as it stands, on logs as the rig's logger writes them."""

from __future__ import annotations

import doctest
import re
import shutil
import subprocess
import sys
from contextlib import chdir
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

import cylinder_friction as cf
from cylinder_friction.rig.campaign import campaign
from cylinder_friction.rig.campaign_plan import CampaignPlan

ROOT = Path(__file__).parents[1]
CYLINDER = cf.Cylinder(bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0)


@pytest.fixture(scope="module")
def checkout(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the rig's logs of a small campaign and the mapping that ships."""
    root = tmp_path_factory.mktemp("checkout")
    (root / "data/raw/rig").mkdir(parents=True)
    shutil.copytree(ROOT / "conf/ingest", root / "conf/ingest")
    plan = CampaignPlan(sessions_per_condition=3, recordings_per_session=1, duration_s=30.0)
    for recording in campaign(CYLINDER, plan):
        recording.logger.to_csv(root / f"data/raw/rig/{recording.metadata.name}.csv", index=False)
    return root


@pytest.fixture(scope="module")
def example(checkout: Path) -> dict[str, Any]:
    """Run the example of the package; return its variables, with which the examples of the names begin."""
    (found,) = doctest.DocTestFinder(recurse=False).find(cf, "cylinder_friction")
    with chdir(checkout):
        outcome = doctest.DocTestRunner().run(found, clear_globs=False)
    assert (outcome.failed, outcome.attempted > 10) == (0, True)
    return found.globs


def documented() -> list[tuple[str, str]]:
    """Find the names that the package offers, and those with an example in the other modules of the reference."""
    pages = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "docs/api").glob("*.md"))
    modules = [import_module(name) for name in sorted(set(re.findall(r"automodule:: (cylinder_friction\.\S+)", pages)))]
    return [("cylinder_friction", name) for name in cf.__all__] + [
        (module.__name__, name)
        for module in modules
        for name, value in vars(module).items()
        if getattr(value, "__module__", "") == module.__name__
        and ">>>" in (value.__doc__ or "")
        and name not in (*cf.__all__, "load_estimator")
    ]


def each_documented() -> list[Any]:
    """Mark the example that searches for parameters as extended."""
    searches = pytest.mark.extended
    return [pytest.param(*each, marks=searches if each[1] == "identify_logs" else ()) for each in documented()]


@pytest.mark.parametrize(("module", "name"), each_documented())
def test_every_name_has_an_example_that_runs(
    module: str, name: str, example: dict[str, Any], checkout: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(checkout)
    value = getattr(import_module(module), name)
    (found,) = doctest.DocTestFinder(recurse=False).find(value, name, globs=dict(example))
    outcome = doctest.DocTestRunner().run(found)
    assert (outcome.failed, outcome.attempted > 1) == (0, True)


def test_an_unknown_name_is_refused() -> None:
    with pytest.raises(AttributeError, match="has no attribute 'Hybrid'; it offers Cylinder"):
        _ = cf.Hybrid


def test_importing_the_package_imports_no_library() -> None:
    code = "import cylinder_friction, sys; print(*sys.modules)"
    imported = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert not {"numpy", "pandas", "torch", "sklearn", "mlflow", "onnx"} & set(imported)
