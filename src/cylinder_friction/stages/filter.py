"""Stage ``filter``: add smooth pressures, velocity and acceleration to the raw signals, off line."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from cylinder_friction.execution.progress import progress
from cylinder_friction.execution.selection import workers_from_environment
from cylinder_friction.files.whole_files import whole_folder, write_json
from cylinder_friction.recordings.storage import read_recording, recording_paths, write_recording
from cylinder_friction.run_record import RunRecord
from cylinder_friction.signals.methods import filters_by_method, warn_of_rates
from cylinder_friction.signals.smooth_signals import filtered
from cylinder_friction.stages._stage import FILTERS_FILE, RECORDINGS_FOLDER, SIGNALS_FOLDER, datasets, flat

if TYPE_CHECKING:
    from pathlib import Path

    from cylinder_friction.params.checking import Params
    from cylinder_friction.signals.smooth_signals import SignalFilter


def run(params: Params) -> RunRecord:
    """Read ``data/interim/recordings``, write ``data/interim/signals``; the raw columns stay as they are.

    Adds ``pressure_1_smooth_pa``, ``pressure_2_smooth_pa``, ``velocity_m_s`` and ``acceleration_m_s2``. If a drive
    force was measured instead of pressures, ``drive_force_smooth_n`` replaces the first two. A measured load adds
    ``load_force_smooth_n``. All are stored in single precision, thousands of times finer than any sensor's step.
    ``filters.json``, in the same folder, holds the method in use and the settings of every method.
    """
    settings, paths = params.filter, recording_paths(RECORDINGS_FOLDER)
    chosen = filters_by_method(params.cylinder, **settings.model_dump(exclude={"method"}))[settings.method]
    with workers_from_environment() as workers, whole_folder(SIGNALS_FOLDER) as folder:
        write_json(folder / FILTERS_FILE.name, settings.model_dump())
        pieces = [partial(write_filtered, path, chosen, folder) for path in paths]
        done = workers.all_in_order(pieces, [path.stem for path in paths])
        written = list(progress(done, "filter", len(paths), unit="recording"))
    warn_of_rates(chosen, {sample_time_s for _, sample_time_s in written}, in_pipeline=True)
    return RunRecord(
        name="filter",
        params=flat(settings),
        metrics={"recordings": float(len(paths)), "rows": float(sum(rows for rows, _ in written))},
        datasets=datasets({"recordings": RECORDINGS_FOLDER}),
    )


def write_filtered(path: Path, chosen: SignalFilter, folder: Path) -> tuple[int, float]:
    """Write one recording with its smooth signals into a folder; return its rows and its sample time [s]."""
    recording = read_recording(path)
    write_recording(folder, filtered(recording, chosen))
    return len(recording), recording.sample_time_s
