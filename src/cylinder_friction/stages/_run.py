"""How a stage is run: check the whole configuration, do the work, note what was done, tell MLflow."""

from __future__ import annotations

import importlib
from pathlib import Path

from cylinder_friction.params.checking import Params, ParamsError, load_params
from cylinder_friction.recordings.files import write_json
from cylinder_friction.stages._stage import RUNS_FOLDER
from cylinder_friction.tracking.log_run import track_or_warn
from cylinder_friction.tracking.replay import PIPELINE_ORDER
from cylinder_friction.tracking.resources import sampled_resources


def run_stage(name: str) -> None:
    """Run one stage in the current directory, the repository root.

    Raises:
        ParamsError: There is no such stage; or anything in ``params.yaml`` is refused, in whichever section, so that
            no stage starts on half a truth.
    """
    if name not in PIPELINE_ORDER:
        raise ParamsError(f"no stage {name!r}; expected one of {', '.join(PIPELINE_ORDER)}")
    params: Params = load_params()
    root = Path.cwd()
    with sampled_resources(name, root):
        record = importlib.import_module(f"cylinder_friction.stages.{name}").run(params)
    write_json(RUNS_FOLDER / f"{name}.json", record.to_dict())
    track_or_warn(record, root)
