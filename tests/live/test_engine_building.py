"""An engine is compiled once for a model, and never half there."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from cylinder_friction.deployment.c_export.compiled import NoCompilerError
from cylinder_friction.live.engine import LIBRARY, Engine
from cylinder_friction.live.engine_building import built_engine

if TYPE_CHECKING:
    from pathlib import Path

    from cylinder_friction.estimators.hybrid import HybridEstimator


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
