"""Stage ``fleet``: the logs of a simulated fleet, one cylinder per fate, and the files that name them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from cylinder_friction.execution.selection import workers_from_environment
from cylinder_friction.fleet.demonstration import write_demonstration
from cylinder_friction.params.file import ParamsError
from cylinder_friction.recordings.files import hash_of, whole_folder
from cylinder_friction.rig.lives import FATES, LifePlan
from cylinder_friction.run_record import Dataset, RunRecord
from cylinder_friction.stages._stage import flat

if TYPE_CHECKING:
    from cylinder_friction.params.checking import Params

FLEET_FOLDER = Path("data/raw/fleet")


def run(params: Params) -> RunRecord:
    """Write ``data/raw/fleet``: ``fleet.yaml``, ``channels.yaml`` and a folder of logs per cylinder.

    Raises:
        ParamsError: The parameters name no fleet.
    """
    plan = params.fleet.simulated
    if plan is None:
        raise ParamsError("fleet: names no simulated fleet; compose the parameters with experiment=fleet")
    with whole_folder(FLEET_FOLDER) as folder, workers_from_environment() as workers:
        write_demonstration(folder, LifePlan(**plan.model_dump()), workers)
    sessions = plan.sessions * len(FATES)
    return RunRecord(
        name="fleet",
        params=flat(plan),
        metrics={"cylinders": float(len(FATES)), "sessions": float(sessions)},
        datasets={"fleet": Dataset(FLEET_FOLDER.as_posix(), hash_of(FLEET_FOLDER), {}, 0)},
    )
