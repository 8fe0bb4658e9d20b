"""The whole configuration, and how it is checked."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import Field, ValidationError, model_validator

from cylinder_friction.params.data import (
    CylinderParams,
    FilterParams,
    LabelParams,
    OffsetParams,
    RecordParams,
    SplitParams,
)
from cylinder_friction.params.ingest import IngestParams
from cylinder_friction.params.learning import (
    BaselinesParams,
    CompareParams,
    LugreParams,
    RegisterParams,
    SearchParams,
    TrainParams,
)
from cylinder_friction.params.section import Section

REFERENCE_CYLINDER = "Bosch H160CA 63x28"
"""Cylinder of the simulated rig as shipped, whose models need no name of their own."""
PARAMS_FILE = Path("params.yaml")
IN_A_PROJECT = "run this in a project's folder, which `cylinder-friction init FOLDER` makes"
Kind = TypeVar("Kind", bound=Section)


class ParamsError(ValueError):
    """A configuration that is refused; the message names the key."""


class Params(Section):
    """The whole configuration, one section a stage."""

    cylinder: CylinderParams
    record: RecordParams
    ingest: IngestParams
    filter: FilterParams
    label: LabelParams
    split: SplitParams
    offset: OffsetParams
    search: SearchParams
    train: TrainParams
    baselines: BaselinesParams
    lugre: LugreParams
    compare: CompareParams
    register_: RegisterParams = Field(alias="register")

    @property
    def registered_name(self) -> str:
        """Name in the registry: ``register.model_name``, with the cylinder's behind it if that is another one."""
        name = self.cylinder.name
        suffix = "" if name == REFERENCE_CYLINDER else "-" + re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")
        return self.register_.model_name + suffix

    @model_validator(mode="after")
    def _end_stop_margin_leaves_room(self) -> Params:
        if 2.0 * self.label.end_stop_margin_m >= self.cylinder.stroke_m:
            raise ValueError(
                f"label.end_stop_margin_m is {self.label.end_stop_margin_m} m at either end, which leaves nothing of "
                f"the stroke of {self.cylinder.stroke_m} m; make it smaller"
            )
        return self


def check_params(content: Any, where: str) -> Params:
    """Return the typed parameters; see ``checked``."""
    return checked(Params, content, where)


def checked(kind: type[Kind], content: Any, where: str) -> Kind:
    """Return typed parameters, or refuse them with every offending key named.

    Args:
        kind: What they are checked against.
        content: What the YAML file or Hydra gave.
        where: Name of the source, for the message.

    Raises:
        ParamsError: A key is unknown or missing, a type is wrong or a value impossible.
    """
    try:
        # As JSON, so that in strict mode a mapping may be a dataclass, and a list a pair.
        return kind.model_validate_json(json.dumps(content, default=str))
    except ValidationError as error:
        lines = [_explain(dict(problem), where) for problem in error.errors()]
        raise ParamsError(f"{where}: refused, nothing was run\n  " + "\n  ".join(lines)) from None


def load_params(path: Path = PARAMS_FILE) -> Params:
    """Read and check ``params.yaml``."""
    if not path.is_file():
        raise ParamsError(f"{path}: not there; {IN_A_PROJECT}")
    return check_params(yaml.safe_load(path.read_text(encoding="utf-8")), str(path))


def _explain(problem: dict[str, Any], where: str) -> str:
    key = ".".join(str(part) for part in problem["loc"]) or "(whole file)"
    if problem["type"] in ("extra_forbidden", "unexpected_keyword_argument"):
        return f"{key}: unknown key; check its spelling against conf/"
    if problem["type"] == "missing":
        if Path(where).name == PARAMS_FILE.name:
            program = "`cylinder-friction params` (in benchmark/: `friction-benchmark params`)"
            return f"{key}: missing; run {program} to compose it from conf/"
        return (
            f"{key}: missing, conf/ was made for another version; copy it from conf/{problem['loc'][0]}/ of a new "
            "folder, which `cylinder-friction init FOLDER` makes"
        )
    got = "" if isinstance(problem["input"], dict) else f", but got {problem['input']!r}"
    return f"{key}: {problem['msg'].removeprefix('Value error, ')}{got}"
