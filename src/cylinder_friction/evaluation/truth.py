"""Read the true friction of recordings from a simulated rig. Only audit, comparison and gate use it."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq

from cylinder_friction.arrays import Array
from cylinder_friction.recordings.recording import Recording, RecordingError

TRUTH_COLUMNS = ("time_s", "friction_n", "velocity_m_s")


def read_truth(folder: Path, recording: Recording) -> pd.DataFrame | None:
    """Read the truth at the recording's rows; None if ``<folder>/<name>.parquet`` does not exist.

    Columns, at least: ``time_s``, ``friction_n`` [N, opposing positive velocity], ``velocity_m_s``.
    """
    path = folder / f"{recording.name}.parquet"
    if not path.is_file():
        return None
    truth = pd.DataFrame(pq.read_table(path).to_pandas())
    missing = [column for column in TRUTH_COLUMNS if column not in truth.columns]
    if missing:
        raise RecordingError(f"{path}: column {missing[0]!r} is missing; got columns {list(truth.columns)}")
    time_s, name, slack_s = recording.column("time_s"), recording.name, 0.5 * recording.sample_time_s
    begins = int(np.searchsorted(truth["time_s"], time_s[0] - slack_s))
    truth = truth.iloc[begins : begins + len(time_s)].reset_index(drop=True)
    if len(truth) != len(time_s):
        raise RecordingError(f"{path}: has {len(truth)} rows, but recording {name!r} has {len(time_s)}")
    late = np.flatnonzero(np.abs(truth["time_s"].to_numpy() - time_s) > slack_s)
    if len(late):
        row = int(late[0])
        raise RecordingError(
            f"{path}: time_s is {truth['time_s'].iloc[row]:.6g} s in row {row + 1}, but recording {name!r} has "
            f"{time_s[row]:.6g} s there; expected the truth of this very recording"
        )
    return truth


def known_truth(folder: str, recordings: Sequence[Recording]) -> dict[str, Array]:
    """Read true friction [N] by recording name, for the recordings whose true friction is in ``folder``."""
    truths = {recording.name: read_truth(Path(folder), recording) for recording in recordings}
    return {name: truth["friction_n"].to_numpy(dtype=np.float64) for name, truth in truths.items() if truth is not None}
