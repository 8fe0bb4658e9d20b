"""How a stage is run: check the whole configuration, do the work, write down what was done, log it to MLflow."""

import importlib
from dataclasses import replace
from pathlib import Path

from cylinder_friction.import_graph import code_key
from cylinder_friction.params.checking import ParamsError, load_params
from cylinder_friction.recordings.files import write_json
from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.recordings.storage import read_metadata, recording_paths
from cylinder_friction.run_record import RUNS_FOLDER, STAGES
from cylinder_friction.stages._stage import PROCESSED_FOLDERS
from cylinder_friction.tracking.log_run import track_or_warn
from cylinder_friction.tracking.measurement import measured


def run_stage(name: str) -> None:
    """Run one stage in the current directory, the repository root.

    Raises:
        ParamsError: There is no such stage; or anything in ``params.yaml`` is refused, in whichever section, so that
            no stage starts on half a configuration.
        RecordingError: No training recording is of the condition that ``lugre.condition`` names.
    """
    if name not in STAGES:
        raise ParamsError(f"no stage {name!r}; expected one of {', '.join(STAGES)}")
    params = load_params()
    if name in ("search", "train", "baselines", "lugre"):  # before hours of training: ``lugre`` may come after it
        _refuse_unknown_condition(PROCESSED_FOLDERS["train"], params.lugre.condition)
    root, module = Path.cwd(), f"cylinder_friction.stages.{name}"
    code = code_key(module)
    with measured() as measurement:
        record = replace(importlib.import_module(module).run(params), code=code)
    write_json(RUNS_FOLDER / f"{name}.json", record.to_dict())
    measurement.keep(record, root)
    track_or_warn(record, root)


def _refuse_unknown_condition(folder: Path, condition: str) -> None:
    conditions = {read_metadata(path).condition for path in recording_paths(folder)}
    if condition not in conditions:
        raise RecordingError(
            f"{folder}: no recording of condition {condition!r}; got conditions {sorted(conditions)}; "
            "name one of them as lugre.condition in params.yaml"
        )
