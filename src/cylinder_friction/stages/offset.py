"""Stage ``offset``: subtract each session's offset of the sensors' zeros from its labels, and note it for training."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import TypeAdapter

from cylinder_friction.files.whole_files import read_json, whole_folder, write_json, write_text
from cylinder_friction.labelling.apparent_loss import loss_of_labels
from cylinder_friction.labelling.label import with_common_load
from cylinder_friction.labelling.load import LoadIdentification
from cylinder_friction.labelling.pooled_load import pooled_load, refuse_unlike_loads
from cylinder_friction.labelling.session_offsets import take_offsets
from cylinder_friction.labelling.sliding_blocks import OffsetPlan
from cylinder_friction.realtime.position_load import channel_names
from cylinder_friction.recordings.columns import LOAD_FORCE, OIL_TEMPERATURE, SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.recordings.storage import read_recording, write_recording
from cylinder_friction.run_record import RunRecord
from cylinder_friction.stages._stage import (
    ESTIMATORS_FILE,
    IDENTIFIED_FILE,
    INGESTED_FILE,
    LABELLED_FOLDER,
    OFFSET_FILE,
    PROCESSED_FOLDERS,
    SPLIT_FILE,
    artifacts,
    datasets,
    flat,
)

if TYPE_CHECKING:
    from cylinder_friction.params.checking import Params
    from cylinder_friction.params.data import OffsetParams


def run(params: Params) -> RunRecord:
    """Write the recordings of each role into ``data/processed/{train,validation,calibration,test}``.

    The training sessions alone determine friction; every other session is identified by itself. Pressures stay as
    measured.

    Raises:
        RecordingError: ``offset.identify`` is ``always``, but offsets cannot be identified; or ``offset.common_load``
            is set, but sessions carry different loads.
    """
    names, ingested = read_json(SPLIT_FILE), read_json(INGESTED_FILE)
    inputs, settings, cylinder = estimator_inputs(ingested), params.offset, params.cylinder
    recordings: dict[str, list[Recording]] = {
        role: [read_recording(LABELLED_FOLDER / f"{name}.parquet") for name in names[role]] for role in names
    }
    load = None
    if ingested["load"] == "position":
        kind, identified = TypeAdapter(LoadIdentification), read_json(IDENTIFIED_FILE)
        loads = {name: kind.validate_python(each["load"]) for name, each in identified.items()}
        load = pooled_load([loads[name] for name in sorted({each.metadata.session for each in recordings["train"]})])
    if load is not None and settings.common_load:
        refuse_unlike_loads(loads, load)
        recordings = {role: [with_common_load(each, load) for each in own] for role, own in recordings.items()}
    # Leave out recordings without a usable row, for example if the piston rests at a position of unknown load.
    recordings = {role: [each for each in own if each.usable().any()] for role, own in recordings.items()}
    own_loads = load is not None and not settings.common_load
    channels = channel_names(inputs, load)
    found = take_offsets(recordings, cylinder, plan_from(settings), channels, settings.identify, own_loads)
    loss = loss_of_labels(found.recordings["train"], cylinder)
    for role, folder in PROCESSED_FOLDERS.items():
        with whole_folder(folder) as written:
            for recording in found.recordings[role]:
                write_recording(written, recording)
            if not found.recordings[role]:  # DVC would warn of an empty folder with every command
                write_text(written / "README.txt", f"No session has the role {role}.\n")
    write_json(
        ESTIMATORS_FILE,
        {
            "inputs": inputs,
            "position_load": None if load is None else load.to_dict(),
            "offset_tracker": None if found.tracker is None else found.tracker.to_dict(),
        },
    )
    words = "" if loss is None else loss.sentence(cylinder)
    write_json(OFFSET_FILE, {"left_alone_because": found.left_alone_because, "sessions": found.sessions, "loss": words})
    return RunRecord(
        name="offset",
        params=flat(params.offset),
        metrics=_metrics(found.sessions),
        tags={"offsets": found.left_alone_because or "identified"},
        artifacts=artifacts(OFFSET_FILE, ESTIMATORS_FILE),
        datasets=datasets({"labelled": LABELLED_FOLDER}),
    )


def estimator_inputs(ingested: Mapping[str, Any]) -> tuple[str, ...]:
    """List the columns of a sample: signals that the label uses and that can be measured in real time."""
    load = [LOAD_FORCE] if ingested["load"] == "measured" else ingested["other_positions"]
    return (*SAMPLE_COLUMNS, *load, *([OIL_TEMPERATURE] if ingested["oil_temperature"] == "input" else []))


def plan_from(settings: OffsetParams) -> OffsetPlan:
    """Make the plan for identifying offsets from the configuration."""
    return OffsetPlan(**settings.model_dump(exclude={"identify", "common_load"}))


def _metrics(sessions: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    if not sessions:
        return {}
    return {
        "sessions": float(len(sessions)),
        "largest_offset_n": max(abs(each["offset_n"]) for each in sessions),
        "mean_uncertainty_n": float(np.mean([each["standard_uncertainty_n"] for each in sessions])),
    }
