"""An engine is compiled once for a model, and never half there."""

import subprocess
import sys
from pathlib import Path

import pytest

from cylinder_friction.deployment.c_export.compiled import NoCompilerError
from cylinder_friction.estimators import loading
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.service.live.engine import LIBRARY, Engine
from cylinder_friction.service.live.engine_building import built_engine, engine_of


def test_an_engine_is_compiled_once(small_hybrid: HybridEstimator, tmp_path: Path) -> None:
    folder = built_engine(small_hybrid, tmp_path)
    compiled = (folder / LIBRARY).stat().st_mtime_ns
    assert built_engine(small_hybrid, tmp_path) == folder
    assert (folder / LIBRARY).stat().st_mtime_ns == compiled
    assert [path.name for path in tmp_path.iterdir()] == [folder.name]
    assert Engine(folder).inputs == small_hybrid.inputs


def test_without_a_compiler_nothing_is_left(
    small_hybrid: HybridEstimator, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path / "nothing"))
    with pytest.raises(NoCompilerError, match="install gcc or clang"):
        built_engine(small_hybrid, tmp_path / "engines")
    assert list((tmp_path / "engines").iterdir()) == []


def test_a_start_needs_neither_the_estimator_nor_a_compiler_until_either_changes(
    small_hybrid: HybridEstimator, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model, engines = tmp_path / "model", tmp_path / "engines"
    small_hybrid.save(model)
    folder = engine_of(model, engines)
    assert Engine(folder).called == ""
    monkeypatch.setenv("PATH", str(tmp_path / "nothing"))
    monkeypatch.setattr(loading, "load_estimator", None)
    for called in ("the first press", "the second press"):
        assert engine_of(model, engines, called) == folder
        assert Engine(folder).called == called
    (model / "note.txt").write_text("changed", encoding="utf-8")
    with pytest.raises(TypeError):
        engine_of(model, engines)


def test_a_start_imports_nothing_that_it_does_not_need_itself() -> None:
    code = "import sys, cylinder_friction.commands.live; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    later = {"numba", "scipy", "pandas", "matplotlib", "mlflow", "torch", "pyarrow", "prometheus_client", "numexpr"}
    assert later & set(done.stdout.split()) == set()
