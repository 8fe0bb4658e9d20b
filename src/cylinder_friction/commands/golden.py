"""Not a stage: the golden trajectories, recorded by an explicit command and checked by another.

They are cut from the test recordings, and some then spoilt as sensors and loggers spoil them. All figures below count
rows of a recording at 200 Hz.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.estimators.hybrid import ForestPlan, HybridEstimator
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.estimators.training_plan import Architecture, TrainingPlan
from cylinder_friction.realtime.from_hybrid import step_model
from cylinder_friction.realtime.golden import (
    MODEL_FOLDER,
    read_trajectories,
    trace,
    write_trajectory,
)
from cylinder_friction.realtime.stream import RealTimeStream
from cylinder_friction.recordings.files import whole_folder
from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.recordings.storage import read_recordings
from cylinder_friction.stages._stage import PROCESSED_FOLDERS, cylinder_from

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from cylinder_friction.params.checking import Params
    from cylinder_friction.realtime.model import StepModel
    from cylinder_friction.recordings.recording import Recording

    Array = NDArray[np.float64]

ROWS = 1000
REST_M_S = 1e-3
SATURATED_PA = 9e6
END_STOP_PA = 6e6
ARCHITECTURE = Architecture(layers=1, nodes=16, dropout=0.0, learning_rate=5e-3)
PLAN = TrainingPlan(epochs=40, patience=40, sequence_length=400, burn_in=50, batch_size=16, schedule="cosine")
FOREST = ForestPlan(trees=16, depth=6, rows=20_000, leaf=40)


def train_golden_model(folder: Path, params: Params) -> None:
    """Train the small model of the golden trajectories on the first training recording of each test."""
    firsts = {
        recording.metadata.condition: recording for recording in reversed(read_recordings(PROCESSED_FOLDERS["train"]))
    }
    hybrid = HybridEstimator(cylinder_from(params.cylinder), "force_balance", ARCHITECTURE, PLAN, FOREST)
    hybrid.fit_with_validation(
        [firsts[condition] for condition in sorted(firsts)], read_recordings(PROCESSED_FOLDERS["validation"])
    )
    with whole_folder(folder / MODEL_FOLDER) as draft:
        hybrid.save(draft)


def record_golden(folder: Path) -> str:
    """Records every trajectory anew with the model in ``folder``; returns what was written, in words."""
    model = _model(folder)
    recordings = read_recordings(PROCESSED_FOLDERS["test"])
    lines = []
    for name, samples in golden_samples(recordings).items():
        trajectory = trace(model, samples)
        write_trajectory(folder, name, trajectory)
        lines.append(f"{name}: {len(samples)} samples")
    return "\n".join(lines)


def check_golden(folder: Path) -> tuple[str, bool]:
    """Compare what the reference and the compiled step make of the trajectories with what was recorded.

    Returns:
        One line a trajectory, and whether every number and every flag is the same bit for bit.
    """
    model = _model(folder)
    lines, same = [], True
    for name, golden in read_trajectories(folder).items():
        now = trace(model, golden.samples)
        newtons, flags = RealTimeStream(model).run(golden.samples)
        for runtime, got, got_flags in (("reference", now.newtons, now.flags), ("python", newtons, flags)):
            apart_n = float(np.abs(got - golden.newtons).max())
            other = int(np.count_nonzero(got_flags != golden.flags))
            same &= apart_n == 0.0 and other == 0
            lines.append(f"{name}: {runtime} differs by {apart_n:.3g} N and in {other} flags")
    return "\n".join(lines), same


def golden_samples(recordings: list[Recording]) -> dict[str, Array]:
    """Return the raw samples of every trajectory by name, each of shape ``(n, 3)``.

    Raises:
        RecordingError: The recordings are too short to be cut from.
    """
    if not recordings or max(map(len, recordings)) < 2 * ROWS:
        raise RecordingError(f"golden trajectories are cut from recordings of at least {2 * ROWS} rows; got none")
    moving = [np.abs(recording.column("velocity_m_s")) > REST_M_S for recording in recordings]
    turns = [_turns(recording, moves) for recording, moves in zip(recordings, moving, strict=True)]
    speeds = [np.abs(recording.column("velocity_m_s")) for recording in recordings]
    rests = [(~moves).astype(np.float64) for moves in moving]
    fast, resting = _busiest(recordings, speeds, 2 * ROWS), _busiest(recordings, rests, ROWS)
    return {
        "stick_slip_reversals": _busiest(recordings, turns, 3 * ROWS // 2),
        "long_hold": np.concatenate([fast[:300], np.tile(fast[299], (3 * ROWS // 2, 1))]),
        "pressure_steps": _stepped(resting),
        "saturation": _saturated(fast[:ROWS]),
        "end_stop": _stopped(recordings),
        "bad_samples": _spoilt(fast),
        "frozen": _frozen(fast),
    }


def _model(folder: Path) -> StepModel:
    estimator = load_estimator(folder / MODEL_FOLDER)
    assert isinstance(estimator, HybridEstimator)
    return step_model(estimator)


def _turns(recording: Recording, moving: NDArray[np.bool_]) -> Array:
    """Return 1 where the piston first moves against its last motion, else 0."""
    rows = np.flatnonzero(moving)
    direction = np.sign(recording.column("velocity_m_s")[rows])
    result = np.zeros(len(moving))
    result[rows[1:][direction[1:] != direction[:-1]]] = 1.0
    return result


def _busiest(recordings: list[Recording], measures: list[Array], rows: int) -> Array:
    """Return the samples of the window of all recordings in which a measure, one value a row, sums up highest."""
    best, chosen = -1.0, np.empty((0, 3))
    for recording, measure in zip(recordings, measures, strict=True):
        sums = np.convolve(measure, np.ones(rows), "valid")
        if len(recording) >= rows and sums.max() > best:
            start = int(sums.argmax())
            best, chosen = float(sums.max()), recording.samples()[start : start + rows]
    return chosen


def _stepped(samples: Array) -> Array:
    """Pressure steps on a resting piston: one chamber, then both."""
    result = samples.copy()
    result[700:760, 0] += 2e6
    result[800:900, :2] += 1e6
    return result


def _saturated(samples: Array) -> Array:
    """Pressure transducers at the end of their range while the piston moves."""
    result = samples.copy()
    result[:, :2] = np.minimum(4.0 * result[:, :2], SATURATED_PA)
    return result


def _stopped(recordings: list[Recording]) -> Array:
    """Motion up to the largest position, then pressure rises while the position cannot change."""
    recording = max(recordings[:4], key=lambda each: float(each.samples()[ROWS // 2 : -1, 2].max()))
    samples = recording.samples()
    end = ROWS // 2 + int(samples[ROWS // 2 : -1, 2].argmax())
    stop = np.tile(samples[end], (700, 1))
    stop[:100, 0] = np.linspace(samples[end, 0], END_STOP_PA, 100)
    stop[100:, 0] = END_STOP_PA
    return np.concatenate([samples[end - 300 : end], stop, samples[end : end - 100 : -1]])


def _spoilt(samples: Array) -> Array:
    """Values that are none, from the first row on, in one channel, in two, in all."""
    result = samples.copy()
    result[0, 0], result[1, 2], result[2:4] = np.nan, -np.inf, np.nan
    result[650, 0] = np.nan
    result[700:720, 1] = np.inf
    result[760:800, 2] = 1e3
    result[850:900] = np.nan
    result[900:905, :2] = -1e12
    result[1200:1203, 1] = 5e7
    return result


def _frozen(samples: Array) -> Array:
    """A pressure that stays where it is while the piston moves, then the other, then both."""
    result = samples.copy()
    result[200:400, 0] = result[200, 0]
    result[500:600, 1] = result[500, 1]
    result[700:1000, :2] = result[700, :2]
    return result
