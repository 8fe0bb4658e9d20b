"""The parameters as shipped, with those of some sections changed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

from cylinder_friction.params.checking import check_params

if TYPE_CHECKING:
    from cylinder_friction.params.checking import Params

PARAMS_YAML = Path(__file__).parents[1] / "params.yaml"


def shipped(**sections: dict[str, Any]) -> Params:
    """Return ``params.yaml`` with changes: ``shipped(label={"inertia": "identified"})``."""
    content = yaml.safe_load(PARAMS_YAML.read_text(encoding="utf-8"))
    for name, changes in sections.items():
        content[name] |= changes
    return check_params(content, PARAMS_YAML.name)
