"""The stages of ``dvc.yaml``, run beside it as ``python -m cylinder_friction_monitoring.stages STAGE``.

``code`` writes the hash of the code, ``fleet`` simulates a fleet's logs, and ``monitor`` is the night over them.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError

from cylinder_friction.recordings.files import read_yaml, whole_folder, write_json
from cylinder_friction_monitoring.errors import MonitoringError
from cylinder_friction_monitoring.fleet.demonstration import write_demonstration
from cylinder_friction_monitoring.fleet.fleet_file import REGISTERED, load_fleet
from cylinder_friction_monitoring.fleet.nightly import code_hash, monitor_fleet
from cylinder_friction_monitoring.fleet.processes import cores
from cylinder_friction_monitoring.lives import LifePlan

PARAMS_FILE, CODE_FILE, FLEET_FOLDER = Path("params.yaml"), Path("code.json"), Path("data/fleet")
HEALTH_FOLDER, METRICS_FILE = Path("reports/health"), Path("reports/metrics.json")


class _Section(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class SimulatedFleet(_Section):
    """A simulated fleet, as in ``lives.LifePlan``."""

    seed: int
    sessions: int
    begins: int
    takes: int


class MonitoredFleet(_Section):
    """Paths of a fleet file and of the logs."""

    file: str
    logs: str


class Params(_Section):
    """``params.yaml``."""

    fleet: SimulatedFleet
    monitor: MonitoredFleet


def load_params() -> Params:
    """Read and check ``params.yaml``.

    Raises:
        MonitoringError: A key is missing, unknown or of the wrong type.
    """
    try:
        return Params.model_validate(read_yaml(PARAMS_FILE))
    except ValidationError as error:
        lines = [f"{'.'.join(map(str, each['loc']))}: {each['msg']}" for each in error.errors()]
        raise MonitoringError(f"{PARAMS_FILE}: refused, nothing was run\n  " + "\n  ".join(lines)) from None


def code() -> None:
    """Write ``code.json``, the hash of the code that the other stages run."""
    write_json(CODE_FILE, {"code": code_hash()})


def fleet() -> None:
    """Write ``data/fleet``: ``fleet.yaml``, ``channels.yaml`` and a folder of logs per cylinder."""
    plan = load_params().fleet
    with whole_folder(FLEET_FOLDER) as folder:
        write_demonstration(folder, LifePlan(**plan.model_dump()), cores())


def monitor() -> None:
    """Bring ``reports/health`` up to the logs that the parameters name, and count its answers.

    Raises:
        MonitoringError: The fleet file names a registered model.
    """
    plan = load_params().monitor
    owned = load_fleet(Path(plan.file))
    if registered := [name for name, each in owned.cylinders.items() if each.model.startswith(REGISTERED)]:
        raise MonitoringError(
            f"{plan.file}: {registered[0]} has the model {owned.cylinders[registered[0]].model}, expected a folder; "
            "a registered model changes unseen by DVC: run `cylinder-friction monitor` for it"
        )
    health = monitor_fleet([plan.logs], owned, HEALTH_FOLDER, datetime.now(UTC), cores())
    health.announced()
    answers = Counter(line.answer.replace(" ", "_") for line in health.lines)
    counts = {"cylinders": len(health.lines), "sessions": sum(line.sessions for line in health.lines)}
    write_json(METRICS_FILE, {**counts, "refused": len(health.refused), "answers": dict(sorted(answers.items()))})


STAGES: Mapping[str, Callable[[], None]] = {"code": code, "fleet": fleet, "monitor": monitor}


def main() -> int:
    """Run the stage that the command line names; return 1 with a message if something is refused."""
    try:
        STAGES[sys.argv[1]]()
    except (ValueError, OSError) as error:
        print(f"{sys.argv[1]}: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
