"""Base class of all sections of a configuration, and the check that accepts or refuses a configuration."""

import json
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from cylinder_friction.params.file import PARAMS_FILE, ParamsError

Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
Fraction = Annotated[float, Field(ge=0.0, lt=1.0)]
Count = Annotated[int, Field(ge=1)]
Seed = Annotated[int, Field(ge=0, lt=2**31)]


class Section(BaseModel):
    """One section of ``params.yaml``: frozen, strict, without unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


Kind = TypeVar("Kind", bound=Section)


def checked(kind: type[Kind], content: Any, where: str) -> Kind:
    """Check a configuration and return typed parameters; an error names every invalid key.

    ``where`` names the source for the message.

    Raises:
        ParamsError: A key is unknown or missing, a type is wrong, or a value is impossible.
    """
    try:
        # As JSON, because strict mode then accepts a mapping for a dataclass and a list for a tuple.
        return kind.model_validate_json(json.dumps(content, default=str))
    except ValidationError as error:
        lines = [_explain(dict(problem), where) for problem in error.errors()]
        raise ParamsError(f"{where}: refused, nothing was run\n  " + "\n  ".join(lines)) from None


def _explain(problem: dict[str, Any], where: str) -> str:
    key = ".".join(str(part) for part in problem["loc"]) or "(whole file)"
    if problem["type"] in ("extra_forbidden", "unexpected_keyword_argument"):
        return f"{key}: unknown key; check its spelling against conf/"
    if problem["type"] == "missing":
        if Path(where).name == PARAMS_FILE.name:
            return f"{key}: missing; run the command `params` to compose it from conf/"
        return (
            f"{key}: missing, conf/ was made for another version; copy it from conf/{problem['loc'][0]}/ of a new "
            "folder, which `cylinder-friction init FOLDER` makes"
        )
    got = "" if isinstance(problem["input"], dict) else f", but got {problem['input']!r}"
    return f"{key}: {problem['msg'].removeprefix('Value error, ')}{got}"
