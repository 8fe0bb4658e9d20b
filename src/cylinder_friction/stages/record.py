"""Stage ``record``: simulate the rig's campaign; write the recordings as a logger would, and the truth separately."""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.execution.progress import progress
from cylinder_friction.files.whole_files import whole_folder, write_text
from cylinder_friction.rig.campaign import campaign
from cylinder_friction.rig.sensors import write_logger_csv
from cylinder_friction.run_record import RunRecord
from cylinder_friction.stages._stage import RIG_FOLDER, RIG_TRUTH_FOLDER, flat

if TYPE_CHECKING:
    from cylinder_friction.params.checking import Params

EMPTY_FILE = "README.txt"
EMPTY_TEXT = (
    "The simulated rig was not run (record.sessions_per_condition is 0). It alone knows true friction, so labels are "
    "not audited and estimates are compared with the label.\n"
)


def run(params: Params) -> RunRecord:
    """Write ``data/raw/rig`` (CSV: s, bar, bar, mm, °C) and ``data/raw/rig_truth`` (Parquet, SI), file by file.

    If ``record.sessions_per_condition`` is 0, because you use your own recordings, both folders hold only a note.

    Raises:
        ValueError: See ``rig.campaign.campaign``.
    """
    plan = params.record
    recordings = campaign(params.cylinder, plan)
    rows = 0
    magnitudes_n: defaultdict[str, list[float]] = defaultdict(list)
    with whole_folder(RIG_FOLDER) as logger_folder, whole_folder(RIG_TRUTH_FOLDER) as truth_folder:
        if plan.recordings == 0:
            write_text(logger_folder / EMPTY_FILE, EMPTY_TEXT)
            write_text(truth_folder / EMPTY_FILE, EMPTY_TEXT)
        for recording in progress(recordings, "record", plan.recordings, unit="recording"):
            write_logger_csv(logger_folder / f"{recording.metadata.name}.csv", recording.logger)
            recording.truth.to_parquet(truth_folder / f"{recording.metadata.name}.parquet", index=False)
            rows += len(recording.truth)
            magnitudes_n[recording.metadata.condition].append(float(recording.truth["friction_n"].abs().mean()))
    return RunRecord(
        name="record",
        params=flat(plan) | flat(params.cylinder.to_dict(), "cylinder."),
        metrics={
            "recordings": float(plan.recordings),
            "seconds": plan.recordings * plan.duration_s,
            "rows": float(rows),
            **{f"mean_friction_n/condition_{name}": float(np.mean(values)) for name, values in magnitudes_n.items()},
        },
    )
