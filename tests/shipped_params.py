"""The parameters as shipped, with those of some sections changed."""

from pathlib import Path
from typing import Any

import yaml

from cylinder_friction.params.checking import Params, check_params

PARAMS_YAML = Path(__file__).parents[1] / "params.yaml"


def shipped(**sections: dict[str, Any]) -> Params:
    """Return ``params.yaml`` with changes: ``shipped(label={"inertia": "identified"})``."""
    content = yaml.safe_load(PARAMS_YAML.read_text(encoding="utf-8"))
    for name, changes in sections.items():
        content[name] |= changes
    return check_params(content, PARAMS_YAML.name)
