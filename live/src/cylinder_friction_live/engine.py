"""The compiled step for many sessions, with one call into C for all, checked by the golden trajectory."""

import ctypes
from array import array
from collections.abc import Sequence
from functools import partial
from itertools import accumulate, pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.deployment.golden_trajectory import GoldenError, difference_n
from cylinder_friction.files.whole_files import hash_of, read_json
from cylinder_friction_live.frames import FLAG_BYTES, NEWTONS, ROW_BYTES, EstimateBlock, SampleBlock

NAME, LIBRARY, DESCRIPTION = "friction", "engine.so", "engine.json"

Job = tuple[int, SampleBlock]
"""The slot of a session, and successive samples of it."""


class EngineError(OSError):
    """A folder holds no engine that can be loaded; the message states the folder and the reason."""


class Engine:
    """States of many sessions of one model, stepped by its compiled C.

    Args:
        folder: Folder from ``build_engine``.
        called: The model's folder or registered version, for people; empty if unknown.

    Attributes:
        model: SHA-256 of all numbers of the step.
        inputs: Columns of a sample.
        corrections: Sign and offset of the inputs for which the model's mapping states them, for the page.
        bounds: What lies between the bounds, in words.
        pressure_noise_pa: Greatest noise of the pressures at which the bounds hold [Pa]; 0: not stated.
        sample_time_s: Sample time of the model [s].
        state_bytes: Size of a session's state.
        golden_difference_n: Largest deviation from its golden trajectory, once ``check`` has run it [N].

    Raises:
        EngineError: The folder holds no engine, or a damaged one.
    """

    def __init__(self, folder: Path, called: str = "") -> None:
        try:
            self._load(folder)
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise EngineError(f"{folder}: holds no engine that can be loaded ({error})") from error
        self._states: NDArray[np.uint8] = np.zeros((0, self.state_bytes), dtype=np.uint8)
        self._states_at = 0
        self._free: list[int] = []
        self.golden_difference_n: float | None = None
        self.called = called

    def _load(self, folder: Path) -> None:
        described, library = read_json(folder / DESCRIPTION), (folder / LIBRARY).resolve()
        if hash_of(library) != described["library"]:
            raise ValueError(f"{LIBRARY} is damaged")
        self.model, self.inputs = str(described["model"]), tuple(map(str, described["inputs"]))
        self.sample_time_s, self.state_bytes = float(described["sample_time_s"]), int(described["state_bytes"])
        loaded = ctypes.CDLL(str(library))
        self._batch, self._frames, self._init = (loaded[f"{NAME}_{each}"] for each in ("batch", "frames", "init"))
        self._batch.argtypes = (ctypes.c_void_p, ctypes.c_uint32, *(ctypes.c_void_p,) * 6)
        self._frames.argtypes = (*(ctypes.c_void_p, ctypes.c_uint32) * 2, *(ctypes.c_void_p,) * 2)
        self._init.argtypes = (ctypes.c_void_p,)
        self._batch.restype = self._frames.restype = self._init.restype = None
        self.bounds, self.corrections = str(described["bounds"]), described["corrections"]
        self.pressure_noise_pa = float(described["pressure_noise_pa"])

    def add(self, saved: bytes | None = None) -> int:
        """Add a fresh session, or one with a state from ``saved``; return its slot."""
        if not self._free:
            count = len(self._states)
            grown = np.zeros((max(16, 2 * count), self.state_bytes), dtype=np.uint8)
            grown[:count] = self._states
            self._free = list(range(len(grown) - 1, count - 1, -1))
            self._states, self._states_at = grown, grown.ctypes.data
        slot = self._free.pop()
        if saved is None:
            self._init(self._states[slot].ctypes.data)
        else:
            self._states[slot] = np.frombuffer(saved, dtype=np.uint8)
        return slot

    def remove(self, slot: int) -> None:
        """Free a slot."""
        self._free.append(slot)

    def saved(self, slot: int) -> bytes:
        """Copy a session's whole state as bytes."""
        return self._states[slot].tobytes()

    def run(self, jobs: Sequence[Job]) -> list[tuple[bytes, bytes]]:
        """Step through all jobs in order; return newtons and flags of each, as in ``EstimateBlock``."""
        rows = [samples.rows for _, samples in jobs]
        slots, resets = [slot for slot, _ in jobs], [samples.reset for _, samples in jobs]
        numbers = [array("I", each).tobytes() for each in (slots, resets, rows)]
        inputs = b"".join([samples.content for _, samples in jobs])
        outputs = np.empty((sum(rows), NEWTONS)), np.empty(sum(rows), np.uint32)
        self._batch(self._states_at, len(jobs), *numbers, inputs, *(each.ctypes.data for each in outputs))
        newtons, flags = (each.tobytes() for each in outputs)
        cuts = pairwise(accumulate(rows, initial=0))
        return [
            (newtons[ROW_BYTES * at : ROW_BYTES * end], flags[FLAG_BYTES * at : FLAG_BYTES * end]) for at, end in cuts
        ]

    def run_frames(self, slots: NDArray[np.uint32], rows: int, message: bytes, answer: NDArray[np.void]) -> bytes:
        """Step through a message of sample frames, of one slot each and with ``rows`` each; return estimate frames.

        ``answer`` is memory for as many frames, each as large as one of estimates.
        """
        self._frames(self._states_at, len(slots), slots.ctypes.data, rows, message, answer.ctypes.data)
        return answer.tobytes()

    def check(self, golden: Path) -> None:
        """Run the model's golden trajectory; raises ``GoldenError`` if the engine is too far from it."""
        slot = self.add()
        try:
            trajectory = read_json(golden)
            columns = np.shape(trajectory["samples"])[1:]
            if columns != (len(self.inputs),):
                raise GoldenError(f"its golden trajectory has columns {columns}; expected {list(self.inputs)}")
            self.golden_difference_n = difference_n(partial(self._stepped, slot), trajectory)
        except (ValueError, KeyError, TypeError) as error:
            found = (
                str(error) if isinstance(error, GoldenError) else f"its golden trajectory cannot be read ({error!r})"
            )
            raise GoldenError(
                f"model {self.model[:12]}: {found} ({golden}); it gives no newtons: register it again, or name another"
            ) from error
        finally:
            self.remove(slot)

    def _stepped(self, slot: int, samples: Array) -> tuple[Array, NDArray[np.uint32]]:
        block = EstimateBlock(0, 0, 0.0, *self.run([(slot, SampleBlock(0, 0, 0.0, samples))])[0])
        return block.newtons, block.flags
