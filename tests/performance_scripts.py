"""The commands of ``performance/`` as modules, so that tests call what they print from."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import pytest

FOLDER = Path(__file__).parents[1] / "performance"


def performance_script(name: str) -> Any:
    """Return a command's module."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(FOLDER))
        return importlib.import_module(name)
