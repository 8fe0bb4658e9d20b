"""Run one stage: check the configuration, do the work, write the run record, log it to MLflow."""

import importlib
from dataclasses import replace
from pathlib import Path

from cylinder_friction.execution.measuring import measured
from cylinder_friction.files.whole_files import read_yaml, write_json
from cylinder_friction.params.checking import load_params
from cylinder_friction.params.composing import DEFAULT, as_run_params
from cylinder_friction.params.file import PARAMS_FILE, ParamsError
from cylinder_friction.run_record import RUNS_FOLDER, STAGES
from cylinder_friction.tracking.log_run import track_or_warn
from cylinder_friction.tracking.repository import commit_of, repository_root


def run_stage(name: str) -> None:
    """Run one stage in the current directory, the root of a pipeline.

    Raises:
        ParamsError: There is no such stage, or any section of ``params.yaml`` is refused, so that no stage starts with
            an invalid configuration.
    """
    if name not in STAGES:
        raise ParamsError(f"no stage {name!r}; expected one of {', '.join(STAGES)}")
    params, root = load_params(), Path.cwd()
    with measured() as took:
        record = importlib.import_module(f"cylinder_friction.stages.{name}").run(params)
    record = replace(
        record,
        experiment="" if params.recipe == DEFAULT else params.recipe,
        took=took(),
        commit=commit_of(repository_root(root)),
        pipeline=as_run_params(read_yaml(PARAMS_FILE)) if name in ("compare", "register") else {},
    )
    write_json(RUNS_FOLDER / f"{name}.json", record.to_dict())
    track_or_warn(record, root)
