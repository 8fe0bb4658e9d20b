"""Golden trajectories: raw samples and recorded outputs of the step, which every runtime must reproduce.

They are cut from recordings, and some are then corrupted as sensors and loggers corrupt them. All figures below count
rows of a recording at 200 Hz.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.realtime.stream import RealTimeStream
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording, RecordingError

MODEL_FOLDER = "model"
"""Folder of the model beside the trajectories."""
ROWS = 1000
REST_ROWS = 50
REST_M_S = 1e-3
SATURATED_PA = 9e6
END_STOP_PA = 6e6


@dataclass(frozen=True)
class Trajectory:
    """Inputs and expected outputs.

    Attributes:
        samples: One column per input of the model, by default pressure 1 [Pa], pressure 2 [Pa] and position [m], shape
            ``(n, inputs)``; NaN and infinity occur.
        newtons: Friction, lower and upper bound [N], shape ``(n, 3)``.
        flags: Shape ``(n,)``.
    """

    samples: Array
    newtons: Array
    flags: NDArray[np.int64]


def trace(model: StepModel, samples: Array) -> Trajectory:
    """Record the outputs of the compiled step for samples, shape ``(n, inputs)``: newtons and flags of every sample.

    Use it to make the expected outputs of a runtime of your own. Samples may hold NaN and infinity, which the guard
    flags. It starts from a fresh state.

    Example:
        >>> from cylinder_friction.testing.golden import trace
        >>> trace(hybrid.step_model(), test[0].samples()[:100]).newtons.shape
        (100, 3)
    """
    return Trajectory(samples, *RealTimeStream(model).run(samples))


def write_trajectory(folder: Path, name: str, trajectory: Trajectory) -> None:
    """Write a trajectory as ``<name>.npz`` into a folder, made if missing; equal trajectories give equal bytes.

    Commit the file: a later test reads it back by ``read_trajectories`` and compares a runtime's outputs with it, bit
    for bit in double precision, within a tolerance in single.
    """
    folder.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(
        folder / f"{name}.npz",
        samples=trajectory.samples,
        newtons=trajectory.newtons,
        flags=trajectory.flags.astype(np.uint32),
    )


def read_trajectories(folder: Path) -> dict[str, Trajectory]:
    """Read the trajectories of a folder, as ``write_trajectory`` wrote them, by the names of their files.

    Run your runtime on ``samples`` and compare with ``newtons`` and ``flags``. Files other than ``.npz`` are ignored.

    Raises:
        FileNotFoundError: There is none.
    """
    found = {}
    for path in sorted(folder.glob("*.npz")):
        with np.load(path, allow_pickle=False) as stored:
            found[path.stem] = Trajectory(stored["samples"], stored["newtons"], stored["flags"].astype(np.int64))
    if not found:
        raise FileNotFoundError(f"{folder}: holds no golden trajectory (.npz); write some with `write_trajectory`")
    return found


def golden_samples(recordings: list[Recording], inputs: Sequence[str] = SAMPLE_COLUMNS) -> dict[str, Array]:
    """Compute the raw samples of every trajectory by name, each of shape ``(n, inputs)``.

    Args:
        recordings: Labelled; at least one of ``2 * ROWS`` rows.
        inputs: Columns of a sample; on others than P1, P2 and position there are fewer trajectories.

    Raises:
        RecordingError: The recordings are too short.

    Example:
        >>> from cylinder_friction.testing.golden import golden_samples
        >>> sorted(golden_samples(labelled[:1]))[:3]
        ['bad_samples', 'end_stop', 'frozen']
    """
    if not recordings or max(map(len, recordings)) < 2 * ROWS:
        raise RecordingError(f"golden trajectories are cut from recordings of at least {2 * ROWS} rows; got none")
    moving = [np.abs(recording.column("velocity_m_s")) > REST_M_S for recording in recordings]
    turns = [_turns(recording, moves) for recording, moves in zip(recordings, moving, strict=True)]
    speeds = [np.abs(recording.column("velocity_m_s")) for recording in recordings]
    rests = [(~moves).astype(np.float64) for moves in moving]
    reversals = _busiest(recordings, turns, 3 * ROWS // 2, inputs)
    fast, resting = _busiest(recordings, speeds, 2 * ROWS, inputs), _busiest(recordings, rests, ROWS, inputs)
    result = {
        "stick_slip_reversals": reversals,
        "long_hold": np.concatenate([fast[:300], np.tile(fast[299], (3 * ROWS // 2, 1))]),
        "bad_samples": _corrupted(fast),
    }
    if tuple(inputs) != SAMPLE_COLUMNS:
        return result | {"rest_then_motion": np.concatenate([resting, fast[: ROWS // 2]])}
    return result | {
        "pressure_steps": _stepped(resting),
        "saturation": _saturated(fast[:ROWS]),
        "end_stop": _stopped(recordings),
        "starts_at_rest": _from_rest(recordings, moving),
        "frozen": _frozen(fast),
    }


def _turns(recording: Recording, moving: NDArray[np.bool_]) -> Array:
    """Mark with 1 each row at which the piston starts to move against its last motion; all other rows are 0."""
    rows = np.flatnonzero(moving)
    direction = np.sign(recording.column("velocity_m_s")[rows])
    result = np.zeros(len(moving))
    result[rows[1:][direction[1:] != direction[:-1]]] = 1.0
    return result


def _busiest(recordings: list[Recording], measures: list[Array], rows: int, inputs: Sequence[str]) -> Array:
    """Cut out the samples of the window in which a measure, one value per row, has the largest sum."""
    best, chosen = -1.0, np.empty((0, len(inputs)))
    for recording, measure in zip(recordings, measures, strict=True):
        sums = np.convolve(measure, np.ones(rows), "valid")
        if len(recording) >= rows and sums.max() > best:
            start = int(sums.argmax())
            best, chosen = float(sums.max()), recording.samples(inputs)[start : start + rows]
    return chosen


def _stepped(samples: Array) -> Array:
    """Make pressure steps on a resting piston: one chamber, then both."""
    result = samples.copy()
    result[700:760, 0] += 2e6
    result[800:900, :2] += 1e6
    return result


def _saturated(samples: Array) -> Array:
    """Saturate pressure transducers while the piston moves."""
    result = samples.copy()
    result[:, :2] = np.minimum(4.0 * result[:, :2], SATURATED_PA)
    return result


def _stopped(recordings: list[Recording]) -> Array:
    """Make a motion up to the largest position, then a pressure that rises while the position cannot change."""
    recording = max(recordings[:4], key=lambda each: float(each.samples()[ROWS // 2 : -1, 2].max()))
    samples = recording.samples()
    end = ROWS // 2 + int(samples[ROWS // 2 : -1, 2].argmax())
    stop = np.tile(samples[end], (700, 1))
    stop[:100, 0] = np.linspace(samples[end, 0], END_STOP_PA, 100)
    stop[100:, 0] = END_STOP_PA
    return np.concatenate([samples[end - 300 : end], stop, samples[end : end - 100 : -1]])


def _from_rest(recordings: list[Recording], moving: list[NDArray[np.bool_]]) -> Array:
    """Cut out a start at rest: the longer rest under the least friction, and the motion after it."""
    least_n, chosen = np.inf, np.empty((0, len(SAMPLE_COLUMNS)))
    for recording, moves in zip(recordings, moving, strict=True):
        friction_n = np.abs(recording.column("friction_n"))
        changes = np.flatnonzero(np.diff(moves.astype(int), prepend=1, append=1))
        for begin, end in changes.reshape(-1, 2).tolist():
            held_n = friction_n[begin:end].mean()
            if held_n < least_n and end - begin >= REST_ROWS and begin + ROWS <= len(recording):
                least_n, chosen = held_n, recording.samples()[begin : begin + ROWS]
    return chosen


def _corrupted(samples: Array) -> Array:
    """Insert invalid values from the first row on: in the first input, the last, several inputs, and all."""
    result, last = samples.copy(), samples.shape[1] - 1
    result[0, 0], result[1, last], result[2:4] = np.nan, -np.inf, np.nan
    result[650, 0] = np.nan
    result[700:720, min(1, last)] = np.inf
    result[760:800, last] = 1e3
    result[850:900] = np.nan
    result[900:905, :2] = -1e12
    result[1200:1203, min(1, last)] = 5e7
    return result


def _frozen(samples: Array) -> Array:
    """Freeze one pressure while the piston moves, then the other, then both."""
    result = samples.copy()
    result[200:400, 0] = result[200, 0]
    result[500:600, 1] = result[500, 1]
    result[700:1000, :2] = result[700, :2]
    return result
