"""An engine is compiled once for a model, never half there, and served only if it gives what its model gave."""

import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from cylinder_friction.deployment.c_export.compiled import NoCompilerError
from cylinder_friction.deployment.golden_trajectory import GOLDEN_FILE, GoldenError
from cylinder_friction.estimators import loading
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.files.whole_files import write_json
from cylinder_friction_live import engine_building
from cylinder_friction_live.engine import LIBRARY, Engine
from cylinder_friction_live.engine_building import built_engine, engine_of


def test_an_engine_is_compiled_once(small_hybrid: HybridEstimator, tmp_path: Path) -> None:
    folder = built_engine(small_hybrid, tmp_path)
    compiled = (folder / LIBRARY).stat().st_mtime_ns
    assert built_engine(small_hybrid, tmp_path) == folder
    assert (folder / LIBRARY).stat().st_mtime_ns == compiled
    assert [path.name for path in tmp_path.iterdir()] == [folder.name]
    assert Engine(folder).inputs == small_hybrid.inputs
    assert small_hybrid.bounds is not None
    assert Engine(folder).bounds == small_hybrid.bounds.in_words()


def test_another_program_compiles_its_own_engine(
    small_hybrid: HybridEstimator, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = built_engine(small_hybrid, tmp_path)
    monkeypatch.setattr(engine_building, "_BATCH", f"{engine_building._BATCH}\n/* changed */\n")
    assert built_engine(small_hybrid, tmp_path) != before


def test_no_compiler_no_engine(small_hybrid: HybridEstimator, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path / "nothing"))
    with pytest.raises(NoCompilerError, match="install gcc or clang"):
        built_engine(small_hybrid, tmp_path / "engines")
    assert list((tmp_path / "engines").iterdir()) == []


def test_a_start_compiles_once(small_hybrid: HybridEstimator, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    model, engines = tmp_path / "model", tmp_path / "engines"
    small_hybrid.save(model)
    first = engine_of(model, "the first press", engines)
    monkeypatch.setenv("PATH", str(tmp_path / "nothing"))
    monkeypatch.setattr(loading, "load_estimator", None)
    for called in ("the first press", "the second press"):
        again = engine_of(model, called, engines)
        assert (again.model, again.called) == (first.model, called)
    (model / "note.txt").write_text("changed", encoding="utf-8")
    with pytest.raises(TypeError):
        engine_of(model, "", engines)


def test_a_start_imports_nothing_that_it_does_not_need_itself() -> None:
    code = "import sys, cylinder_friction_live.start; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    later = {"numba", "scipy", "pandas", "matplotlib", "mlflow", "torch", "pyarrow", "prometheus_client", "numexpr"}
    assert later & set(done.stdout.split()) == set()


@pytest.fixture
def registered(model: Path, tmp_path: Path) -> Path:
    """An estimator's folder in a registered model's."""
    return shutil.copytree(model, tmp_path / "registered/hybrid")


def test_the_trajectory_of_the_model_must_be_met(registered: Path, golden: dict[str, Any], tmp_path: Path) -> None:
    path, engines = registered.with_name(GOLDEN_FILE), tmp_path / "engines"
    assert engine_of(registered, "", engines).golden_difference_n is None
    write_json(path, golden)
    assert engine_of(registered, "", engines).golden_difference_n == 0.0
    golden["newtons"][200][0] += 1.0
    write_json(path, golden)
    with pytest.raises(GoldenError, match=r"model [0-9a-f]{12}: on its golden trajectory it is 1 N from what was rec"):
        engine_of(registered, "", engines)
    write_json(path, golden | {"flags": [0, 0]})
    with pytest.raises(GoldenError, match=r"cannot be read \(ValueError"):
        engine_of(registered, "", engines)


def test_a_registered_model_without_its_trajectory_is_refused(registered: Path, tmp_path: Path) -> None:
    with pytest.raises(GoldenError, match=r"models:/friction/3: its golden trajectory, golden\.json, is not there"):
        engine_of(registered, "models:/friction/3", tmp_path / "engines")
