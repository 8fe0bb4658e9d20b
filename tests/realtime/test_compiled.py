"""Machine code in Numba's cache, and what an upgrade leaves of it."""

import importlib
import sys
from pathlib import Path

import pytest

MODULE = """from typing import NamedTuple
from cylinder_friction.realtime.compiled import compiled


class {name}(NamedTuple):
    value: float


@compiled
def twice(numbers):
    return 2.0 * numbers.value
"""


def test_machine_code_for_types_that_are_gone_is_compiled_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    for name in ("BeforeUpgrade", "Renamed"):
        (tmp_path / "upgraded_step.py").write_text(MODULE.format(name=name))
        importlib.invalidate_caches()
        module = importlib.import_module("upgraded_step")
        assert module.twice(getattr(module, name)(1.5)) == 3.0
        del sys.modules["upgraded_step"]
