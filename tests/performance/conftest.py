"""The scripts of performance/ as modules, and the golden model."""

from __future__ import annotations

import sys
from pathlib import Path

from golden_fixtures import golden_model, hybrid, lugre, samples

__all__ = ["golden_model", "hybrid", "lugre", "samples"]
sys.path.append(str(Path(__file__).parents[2] / "performance"))
