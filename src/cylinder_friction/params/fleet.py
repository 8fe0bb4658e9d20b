"""The fleet file: which cylinders there are, and how a log names its own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import Field

from cylinder_friction.fleet.plan import Assignment, Fleet, FleetCylinder
from cylinder_friction.params.file import ParamsError
from cylinder_friction.params.section import Count, Section, Seed, checked
from cylinder_friction.recordings.files import read_yaml

REGISTERED = "models:/"
"""How the name of a registered model begins."""
EXAMPLE = """\
assign: {by: folder}
cylinders:
  press-1:
    dimensions: {bore_diameter_m: 0.063, rod_diameter_m: 0.028, stroke_m: 0.25, moving_mass_kg: 6.0}
    channels: channels.yaml"""


class SimulatedFleet(Section):
    """A simulated fleet, as in ``rig.lives.LifePlan``."""

    seed: Seed
    sessions: Count
    begins: Count
    takes: Count


class SimulationParams(Section):
    """The section ``fleet`` of ``params.yaml``: the fleet that is simulated, if any."""

    simulated: SimulatedFleet | None = None


class MonitoredFleet(Section):
    """Paths of a fleet file and of the logs."""

    file: str
    logs: str


class MonitorParams(Section):
    """The section ``monitor`` of ``params.yaml``: the fleet that is monitored, if any."""

    fleet: MonitoredFleet | None = None


class FleetParams(Section):
    """``fleet.yaml``.

    Attributes:
        assign: How a log names its cylinder.
        database: Where the tables go beside Parquet: ``postgresql://...``; empty: an SQLite file in the results.
        defaults: What all cylinders have in common; each may state it otherwise.
        cylinders: By name.
    """

    assign: Assignment = Assignment()
    database: str = ""
    cylinders: dict[str, FleetCylinder] = Field(min_length=1)


def load_fleet(path: Path) -> Fleet:
    """Read and check a fleet file; paths in it are relative to its folder.

    Raises:
        ParamsError: It is not there, a key is unknown or missing, or a value impossible.
    """
    if not path.is_file():
        raise ParamsError(f"{path}: no such file; write one that names your cylinders, for example\n{EXAMPLE}")
    content = read_yaml(path)
    defaults, cylinders = content.pop("defaults", None) or {}, content.get("cylinders")
    if isinstance(cylinders, dict) and isinstance(defaults, dict):
        content["cylinders"] = {str(name): _merged(defaults, own, path.parent) for name, own in cylinders.items()}
    if isinstance(content.get("assign"), dict):
        content["assign"] = _placed(content["assign"], "table", path.parent)
    params = checked(FleetParams, content, str(path), "docs/monitoring.md")
    try:
        return Fleet(params.cylinders, params.assign, params.database)
    except ValueError as error:
        raise ParamsError(f"{path}: {error}") from None


def _merged(defaults: dict[str, Any], own: Any, folder: Path) -> Any:
    if own is not None and not isinstance(own, dict):
        return own
    placed = _placed({**defaults, **(own or {})}, "channels", folder)
    model = str(placed.get("model", ""))
    return _placed(placed, "model", folder) if model and not model.startswith(REGISTERED) else placed


def _placed(content: dict[str, Any], key: str, folder: Path) -> dict[str, Any]:
    return content | ({key: str(folder / content[key])} if isinstance(content.get(key), str) else {})
