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
from cylinder_friction_live.engine import DESCRIPTION, LIBRARY, Engine, EngineError
from cylinder_friction_live.engine_building import build_engine, engine_of


def test_an_engine_states_what_its_estimator_takes_and_gives(engine: Engine, small_hybrid: HybridEstimator) -> None:
    assert engine.inputs == small_hybrid.inputs
    assert small_hybrid.bounds is not None
    assert engine.bounds == small_hybrid.bounds.in_words()


@pytest.mark.parametrize("name", [LIBRARY, DESCRIPTION])
@pytest.mark.parametrize("damage", [b"", b"\xff{", None])
def test_a_damaged_engine_is_named_and_compiled_again_once(
    model: Path, tmp_path: Path, name: str, damage: bytes | None, caplog: pytest.LogCaptureFixture
) -> None:
    engine_of(model, "", tmp_path)
    (folder,) = tmp_path.iterdir()
    path = folder / name
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.unlink()  # the loaded library stays as it is
    if (name, damage) != (DESCRIPTION, None):
        path.write_bytes(bytes(content) if damage is None else damage)
    with pytest.raises(EngineError, match=f"{folder}: holds no engine that can be loaded"):
        Engine(folder)
    engine_of(model, "", tmp_path)
    compiled = path.stat().st_mtime_ns
    engine_of(model, "", tmp_path)
    assert path.stat().st_mtime_ns == compiled
    (record,) = caplog.records
    assert record.message.startswith(f"{folder}: holds no engine")
    assert record.message.endswith("; it is compiled again")


def test_no_compiler_no_engine(small_hybrid: HybridEstimator, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path / "nothing"))
    with pytest.raises(NoCompilerError, match="install gcc or clang"):
        build_engine(small_hybrid, tmp_path / "engine")
    assert list(tmp_path.iterdir()) == []


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
