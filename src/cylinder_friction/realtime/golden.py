"""Golden trajectories: raw samples, and what the reference made of them, recorded once and kept."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.realtime.reference import ReferenceStream

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from cylinder_friction.realtime.model import StepModel

    Array = NDArray[np.float64]

MODEL_FOLDER = "model"
"""Folder of the model beside the trajectories."""


@dataclass(frozen=True)
class Trajectory:
    """What goes in and what must come out.

    Attributes:
        samples: Pressure 1 [Pa], pressure 2 [Pa], position [m], shape ``(n, 3)``; NaN and infinity among them.
        newtons: Friction, lower and upper bound [N], shape ``(n, 3)``.
        flags: Shape ``(n,)``.
    """

    samples: Array
    newtons: Array
    flags: NDArray[np.int64]


def trace(model: StepModel, samples: Array) -> Trajectory:
    """Return what the reference makes of samples, shape ``(n, 3)``."""
    stream = ReferenceStream(model)
    outputs = [stream.step(*sample) for sample in samples]
    return Trajectory(
        samples,
        np.array([output[:3] for output in outputs]).reshape(-1, 3),
        np.array([output.flags for output in outputs], dtype=np.int64),
    )


def write_trajectory(folder: Path, name: str, trajectory: Trajectory) -> None:
    """Write ``<name>.npz``; equal trajectories make equal bytes."""
    folder.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(
        folder / f"{name}.npz",
        samples=trajectory.samples,
        newtons=trajectory.newtons,
        flags=trajectory.flags.astype(np.uint32),
    )


def read_trajectories(folder: Path) -> dict[str, Trajectory]:
    """Return the trajectories of a folder by name.

    Raises:
        FileNotFoundError: There is none.
    """
    found = {}
    for path in sorted(folder.glob("*.npz")):
        with np.load(path, allow_pickle=False) as stored:
            found[path.stem] = Trajectory(stored["samples"], stored["newtons"], stored["flags"].astype(np.int64))
    if not found:
        raise FileNotFoundError(f"{folder}: holds no golden trajectory (.npz); run `cylinder-friction golden record`")
    return found
