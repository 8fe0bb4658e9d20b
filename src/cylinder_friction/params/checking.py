"""The whole configuration and its checks."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from pydantic import Field, field_validator, model_validator

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.files.whole_files import read_yaml
from cylinder_friction.params.data import (
    FilterParams,
    IngestParams,
    LabelParams,
    OffsetParams,
    SplitParams,
)
from cylinder_friction.params.file import IN_A_PROJECT, PARAMS_FILE, ParamsError
from cylinder_friction.params.learning import (
    BaselinesParams,
    CompareParams,
    LugreParams,
    RegisterParams,
    SearchParams,
    TrainParams,
)
from cylinder_friction.params.section import Section, checked
from cylinder_friction.rig.campaign_plan import CampaignPlan

REFERENCE_CYLINDER = "Bosch H160CA 63x28"
"""Cylinder of the simulated rig as shipped; names of its models do not contain the cylinder."""


class Params(Section):
    """The whole configuration, one section per stage; ``recipe`` names the MLflow experiment of its runs."""

    recipe: str = Field(default="default", pattern=r"^[\w-]+$")
    cylinder: Cylinder
    record: CampaignPlan
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
        """Name in the registry: ``register.model_name``, followed by the cylinder unless that is the reference."""
        name = self.cylinder.name
        suffix = "" if name == REFERENCE_CYLINDER else "-" + re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")
        return self.register_.model_name + suffix

    @property
    def champion(self) -> str:
        """MLflow URI of the model in service."""
        return f"models:/{self.registered_name}@champion"

    @field_validator("cylinder", mode="before")
    @classmethod
    def _cylinder_has_a_name(cls, content: Any) -> Any:
        if isinstance(content, dict) and "name" not in content:
            raise ValueError("name is missing; models of this cylinder are registered under its name")
        return content

    @model_validator(mode="after")
    def _end_stop_margin_leaves_room(self) -> Params:
        if 2.0 * self.label.end_stop_margin_m >= self.cylinder.stroke_m:
            raise ValueError(
                f"label.end_stop_margin_m is {self.label.end_stop_margin_m} m at either end, which leaves nothing of "
                f"the stroke of {self.cylinder.stroke_m} m; make it smaller"
            )
        return self


def check_params(content: Any, where: str) -> Params:
    """Check the whole configuration and return the typed parameters; see ``checked``."""
    return checked(Params, content, where)


def load_params(path: Path = PARAMS_FILE) -> Params:
    """Read and check ``params.yaml``."""
    if not path.is_file():
        raise ParamsError(f"{path.absolute()}: not there; {IN_A_PROJECT}")
    return check_params(read_yaml(path), str(path))
