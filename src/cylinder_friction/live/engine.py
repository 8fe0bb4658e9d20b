"""The compiled step for many sessions: one call into C for all that have samples."""

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.deployment.c_export.compiled import OPTIMISED, compile_shared
from cylinder_friction.deployment.c_export.export import export_c
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.recordings.files import write_text

NAME = "friction"
_BATCH = """\
#include "{name}.h"

/* Jobs one after the other: a session's rows together, so that its state is what a single stream's would be. */
void {name}_batch({name}_state *states, uint32_t jobs, const uint32_t *slots, const uint32_t *resets,
                  const uint32_t *rows, const double *samples, {name}_output *outputs)
{{
    uint32_t job, row;

    for (job = 0; job < jobs; job++) {{
        {name}_state *state = states + slots[job];

        if (resets[job])
            {name}_reset(state);
        for (row = 0; row < rows[job]; row++) {{
            {name}_step(state, {arguments}, outputs++);
            samples += {columns};
        }}
    }}
}}
"""
_OUTPUT = np.dtype({"names": ["newtons", "flags"], "formats": [("<f8", 3), "<u4"], "offsets": [0, 24], "itemsize": 32})


@dataclass(frozen=True, slots=True)
class Job:
    """Successive samples of the session in one slot, shape ``(rows, inputs)``; its state is reset first if asked."""

    slot: int
    samples: Array
    reset: bool = False


class Engine:
    """States of many sessions of one model, stepped by its own C.

    Args:
        estimator: Fitted; any that can run in real time.
        folder: Where its source is written and compiled.

    Attributes:
        model: SHA-256 of every number that a step uses.
        inputs: Columns of a sample.
        sample_time_s: The one time between two samples [s].

    Raises:
        ValueError: The estimator has no real-time step, or there is no C compiler (``NoCompilerError``).
    """

    def __init__(self, estimator: FrictionEstimator, folder: Path) -> None:
        exported = export_c(estimator, folder, NAME)
        self.model, self.inputs, self._state_bytes = exported.model, exported.inputs, exported.state_bytes
        self.sample_time_s = float(estimator.sample_time_s or 0.0)
        batch, library = folder / "batch.c", folder / "engine.so"
        arguments = ", ".join(f"samples[{place}]" for place in range(len(self.inputs)))
        write_text(batch, _BATCH.format(name=NAME, arguments=arguments, columns=len(self.inputs)))
        compile_shared((exported.source, batch), library, ("-std=c99", *OPTIMISED))
        loaded = ctypes.CDLL(str(library))
        self._batch, self._init = loaded[f"{NAME}_batch"], loaded[f"{NAME}_init"]
        self._batch.argtypes = (ctypes.c_void_p, ctypes.c_uint32, *(ctypes.c_void_p,) * 5)
        self._init.argtypes = (ctypes.c_void_p,)
        self._batch.restype = self._init.restype = None
        self._states: NDArray[np.uint8] = np.zeros((0, self._state_bytes), dtype=np.uint8)
        self._free: list[int] = []

    def add(self) -> int:
        """Return the slot of a fresh session."""
        if not self._free:
            count = len(self._states)
            grown = np.zeros((max(16, 2 * count), self._state_bytes), dtype=np.uint8)
            grown[:count] = self._states
            self._free = list(range(len(grown) - 1, count - 1, -1))
            self._states = grown
        slot = self._free.pop()
        self._init(self._states[slot].ctypes.data)
        return slot

    def remove(self, slot: int) -> None:
        """Give a slot back."""
        self._free.append(slot)

    def saved(self, slot: int) -> bytes:
        """Return a session's whole state."""
        return self._states[slot].tobytes()

    def restore(self, slot: int, saved: bytes) -> None:
        """Put a saved state of this model back.

        Raises:
            ValueError: It is not as long as a state is.
        """
        if len(saved) != self._state_bytes:
            raise ValueError(f"a saved state has {len(saved)} bytes; expected {self._state_bytes}")
        self._states[slot] = np.frombuffer(saved, dtype=np.uint8)

    def run(self, jobs: Sequence[Job]) -> list[tuple[Array, NDArray[np.uint32]]]:
        """Step through all jobs in order; return newtons, shape ``(rows, 3)``, and flags, ``(rows,)``, of each."""
        rows = [len(job.samples) for job in jobs]
        samples = np.concatenate([job.samples for job in jobs]) if len(jobs) > 1 else jobs[0].samples
        samples = np.ascontiguousarray(samples, dtype=np.float64)
        described = np.array([[job.slot for job in jobs], [job.reset for job in jobs], rows], dtype=np.uint32)
        outputs = np.empty(sum(rows), dtype=_OUTPUT)
        self._batch(
            self._states.ctypes.data, len(jobs), *(each.ctypes.data for each in described), samples.ctypes.data,
            outputs.ctypes.data,
        )  # fmt: skip
        newtons, flags = np.ascontiguousarray(outputs["newtons"]), np.ascontiguousarray(outputs["flags"])
        ends = np.cumsum(rows).tolist()
        return [(newtons[end - count : end], flags[end - count : end]) for end, count in zip(ends, rows, strict=True)]
