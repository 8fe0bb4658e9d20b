"""Stage ``filter``: smooth pressures, velocity and acceleration beside the raw signals, off line."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tqdm import tqdm

from cylinder_friction.recordings.files import whole_folder, write_json
from cylinder_friction.recordings.storage import iterate_recordings, recording_paths, write_recording
from cylinder_friction.run_record import RunRecord
from cylinder_friction.signals.methods import filters_by_method, warn_of_rates
from cylinder_friction.signals.smooth_signals import filtered
from cylinder_friction.stages._datasets import datasets
from cylinder_friction.stages._stage import FILTERS_FILE, RECORDINGS_FOLDER, SIGNALS_FOLDER, cylinder_from, flat

if TYPE_CHECKING:
    from cylinder_friction.params.checking import Params


def run(params: Params) -> RunRecord:
    """Read ``data/interim/recordings``, write ``data/interim/signals``; the raw columns stay as they are.

    Adds ``pressure_1_smooth_pa``, ``pressure_2_smooth_pa``, ``velocity_m_s`` and ``acceleration_m_s2``; where a drive
    force stands in for the pressures, ``drive_force_smooth_n`` in place of the first two; and of a measured load
    ``load_force_smooth_n``. They are stored in single precision, thousands of times finer than any sensor's step.
    ``filters.json`` beside the recordings holds the method and the settings of every method.
    """
    cylinder = cylinder_from(params.cylinder)
    chosen = filters_by_method(cylinder, **params.filter.model_dump(exclude={"method"}))[params.filter.method]
    rows = 0
    sample_times_s: set[float] = set()
    count = len(recording_paths(RECORDINGS_FOLDER))
    with whole_folder(SIGNALS_FOLDER) as folder:
        write_json(folder / FILTERS_FILE.name, params.filter.model_dump())
        for recording in tqdm(iterate_recordings(RECORDINGS_FOLDER), "filter", count, unit="recording", disable=None):
            write_recording(folder, filtered(recording, chosen))
            rows += len(recording)
            sample_times_s.add(recording.sample_time_s)
    warn_of_rates(chosen, sample_times_s)
    return RunRecord(
        name="filter",
        params=flat(params.filter),
        metrics={"recordings": float(count), "rows": float(rows)},
        datasets=datasets({"recordings": RECORDINGS_FOLDER}) | datasets({"signals": SIGNALS_FOLDER}, written=True),
    )
