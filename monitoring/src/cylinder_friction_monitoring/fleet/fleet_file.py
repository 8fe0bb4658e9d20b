"""Read the fleet file: the cylinders, and how a log names its cylinder."""

import json
import re
from collections.abc import Hashable
from pathlib import Path
from typing import Any

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from cylinder_friction_monitoring.errors import MonitoringError
from cylinder_friction_monitoring.fleet.plan import Assignment, Fleet, FleetCylinder

GUIDE = "docs/monitoring.md"
REGISTERED = "models:/"  # How the name of a registered model begins
EXAMPLE = """\
assign: {by: folder}
cylinders:
  press-1:
    dimensions: {bore_diameter_m: 0.063, rod_diameter_m: 0.028, stroke_m: 0.25, moving_mass_kg: 6.0}
    channels: channels.yaml"""


class _Loader(yaml.SafeLoader):
    """Loads YAML as people read it: keys are text and unique, ``1e9`` is a number, and ``no`` is text."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        lines: dict[str, int] = {}
        for key, _ in node.value:
            line = key.start_mark.line + 1
            if not isinstance(key, yaml.ScalarNode):
                raise MonitoringError(f"line {line}: expected a name before the colon")
            if key.value in lines:
                raise MonitoringError(
                    f"line {line}: {key.value!r} is there already, in line {lines[key.value]}; keep one, or rename it"
                )
            lines[key.value] = line
        self.flatten_mapping(node)  # merge the mappings that ``<<`` names
        for key, _ in node.value:
            key.tag = "tag:yaml.org,2002:str"
        return super().construct_mapping(node, deep)


_Loader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in own if tag != "tag:yaml.org,2002:bool"]
    for first, own in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
_FLOAT = re.compile(r"[-+]?\d+(\.\d*)?[eE][-+]?\d+$")
_Loader.add_implicit_resolver("tag:yaml.org,2002:float", _FLOAT, list("-+0123456789"))


class FleetFile(BaseModel):
    """``fleet.yaml`` with its ``defaults`` merged into the cylinders; see ``Fleet``."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    assign: Assignment = Assignment()
    database: str = ""
    cylinders: dict[str, FleetCylinder] = Field(min_length=1)


def load_fleet(path: Path) -> Fleet:
    """Read a fleet file; an error in it raises ``MonitoringError``. Its paths are relative to its folder."""
    if not path.is_file():
        raise MonitoringError(f"{path}: no such file; write one that names your cylinders, for example\n{EXAMPLE}")
    content = _read(path)
    defaults, cylinders = content.pop("defaults", None) or {}, content.get("cylinders")
    if isinstance(cylinders, dict) and isinstance(defaults, dict):
        content["cylinders"] = {name: _merged(defaults, own, path.parent) for name, own in cylinders.items()}
    if isinstance(content.get("assign"), dict):
        content["assign"] = _placed(content["assign"], "table", path.parent)
    params = _checked(content, path)
    try:
        return Fleet(params.cylinders, params.assign, params.database)
    except ValueError as error:
        raise MonitoringError(f"{path}: {error}") from None


def _read(path: Path) -> dict[str, Any]:
    try:
        content = yaml.load(path.read_text(encoding="utf-8"), _Loader)  # noqa: S506 - a safe loader
        json.dumps(content, default=str)  # refuse content that contains itself
    except MonitoringError as error:
        raise MonitoringError(f"{path}, {error}") from None
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise MonitoringError(f"{path}: is no YAML of plain keys and values ({' '.join(str(error).split())})") from None
    if not isinstance(content, dict | None):
        raise MonitoringError(f"{path}: expected keys and values, but got {str(content)[:80]!r}")
    return content or {}


def _merged(defaults: dict[str, Any], own: Any, folder: Path) -> Any:
    if own is not None and not isinstance(own, dict):
        return own
    placed = _placed({**defaults, **(own or {})}, "channels", folder)
    model = str(placed.get("model", ""))
    return _placed(placed, "model", folder) if model and not model.startswith(REGISTERED) else placed


def _placed(content: dict[str, Any], key: str, folder: Path) -> dict[str, Any]:
    return content | ({key: str(folder / content[key])} if isinstance(content.get(key), str) else {})


def _checked(content: Any, path: Path) -> FleetFile:
    try:
        # As JSON, so that in strict mode a mapping may be a dataclass, and a list a tuple.
        return FleetFile.model_validate_json(json.dumps(content, default=str))
    except ValidationError as error:
        lines = [_explained(dict(problem)) for problem in error.errors()]
        raise MonitoringError(f"{path}: refused, nothing was run\n  " + "\n  ".join(lines)) from None


def _explained(problem: dict[str, Any]) -> str:
    key = ".".join(str(part) for part in problem["loc"]) or "(whole file)"
    if problem["type"] in ("extra_forbidden", "unexpected_keyword_argument"):
        return f"{key}: unknown key; check its spelling against {GUIDE}"
    if problem["type"] == "missing":
        return f"{key}: missing; see {GUIDE}"
    got = "" if isinstance(problem["input"], dict) else f", but got {problem['input']!r}"
    return f"{key}: {problem['msg'].removeprefix('Value error, ')}{got}"
