"""Binary frames: samples in, estimates and acknowledgements out; the same over every link.

A message is one block or several, of any sessions. A block is a header of 24 bytes and its numbers, little-endian:

==========  ====  ==========================================================================================
field       type  meaning
==========  ====  ==========================================================================================
kind        u8    1 samples, 2 estimates, 3 acknowledgement
columns     u8    samples: number of the model's inputs; estimates: 3; else 0
rows        u16   samples of the block; 0 in an acknowledgement
handle      u32   the session; the service gives the handle when the session is opened
index       u64   of the first row, counted by the sender from its own beginning; acknowledged: all rows before it
time_s      f64   time of the first row in the sender's clock [s, Unix]
==========  ====  ==========================================================================================

Samples follow as rows × columns f64. Estimates follow as rows × (friction, lower, upper) f64 [N], then rows × flags
u32; if the number of rows is odd, four zero bytes pad the block, so that every block begins at a multiple of eight
bytes.
"""

import struct
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array

SAMPLES, ESTIMATES, ACKNOWLEDGEMENT = range(1, 4)
HEADER = struct.Struct("<BBHIQd")
LARGEST_INDEX = 1 << 53
"""Largest index that JSON can hold exactly."""
LATEST_S = 2.0**33
"""Latest valid time, in the year 2242; a later one comes from bytes in the wrong order."""
NEWTONS = 3
ROW_BYTES, FLAG_BYTES = 8 * NEWTONS, 4
"""Bytes of one estimate's newtons, and of its flags."""
_NUMBER = np.dtype("<f8")


class FrameError(ValueError):
    """A message is no sequence of blocks; none of its blocks is used.

    ``unpack`` raises it with the byte at which the message is wrong, what was found there and what was expected. The
    service answers with the same words, and the connection stays open.
    """


@dataclass(init=False, slots=True)
class SampleBlock:
    """Successive samples of one session, as the bytes that frames, the engine and the journal hold.

    Args:
        handle: Handle of the session.
        index: Index of the first sample.
        time_s: Time of the first sample, in the sender's clock [s, Unix].
        samples: Samples of shape ``(rows, columns)``, or the bytes of rows × columns f64.
        columns: Number of columns, if ``samples`` are bytes.
        reset: Whether the session begins anew with these samples; not in the frame.
    """

    handle: int
    index: int
    time_s: float
    content: bytes
    rows: int
    columns: int
    reset: bool

    def __init__(
        self, handle: int, index: int, time_s: float, samples: Array | bytes, columns: int = 0, reset: bool = False
    ) -> None:
        self.handle, self.index, self.time_s, self.reset = handle, index, time_s, reset
        if isinstance(samples, bytes):
            self.content, self.rows, self.columns = samples, len(samples) // (8 * columns), columns
        else:
            self.content, (self.rows, self.columns) = samples.astype(_NUMBER, copy=False).tobytes(), samples.shape

    @property
    def samples(self) -> Array:
        """The samples, shape ``(rows, columns)``."""
        return np.frombuffer(self.content, _NUMBER).reshape(self.rows, self.columns)


@dataclass(slots=True)
class EstimateBlock:
    """Estimates of successive samples by one model, as the bytes that frames and the journal hold.

    Read ``newtons`` (friction, lower and upper bound [N]) and ``flags``; both have one row per sample, the first of
    which has ``index``. Friction is positive when it opposes extension.
    """

    handle: int  # Handle of the session; 0 if it is not open
    index: int
    time_s: float
    newton_bytes: bytes  # Bytes of rows × (friction, lower, upper) f64
    flag_bytes: bytes  # Bytes of rows × u32
    model: str = ""  # SHA-256; not in the frame

    @classmethod
    def of(cls, handle: int, index: int, time_s: float, newtons: Array, flags: NDArray[np.uint32]) -> "EstimateBlock":
        """Make a block from newtons, shape ``(rows, 3)``, and flags, shape ``(rows,)``."""
        return cls(handle, index, time_s, newtons.astype("<f8").tobytes(), flags.astype("<u4").tobytes())

    def __len__(self) -> int:
        return len(self.flag_bytes) // FLAG_BYTES

    @property
    def newtons(self) -> Array:
        """Friction, lower and upper bound [N], shape ``(rows, 3)``."""
        return np.frombuffer(self.newton_bytes, _NUMBER).reshape(-1, NEWTONS)

    @property
    def flags(self) -> NDArray[np.uint32]:
        """Flags, shape ``(rows,)``."""
        return np.frombuffer(self.flag_bytes, "<u4")

    def after(self, rows: int, sample_time_s: float) -> "EstimateBlock":
        """Drop the first rows of the block."""
        newtons, flags = self.newton_bytes[ROW_BYTES * rows :], self.flag_bytes[FLAG_BYTES * rows :]
        return EstimateBlock(
            self.handle, self.index + rows, self.time_s + rows * sample_time_s, newtons, flags, self.model
        )


@dataclass(slots=True)
class Acknowledgement:
    """All samples of a session before ``index`` are in the journal, whatever happens to the service.

    A client may forget them then. After a lost connection it sends again from the last acknowledged index on; samples
    that arrive twice are counted once.
    """

    handle: int
    index: int


def pack_samples(block: SampleBlock) -> bytes:
    """Pack one block of samples as the bytes of a frame: a header of 24 bytes, then rows × columns f64.

    Join the results to send several blocks in one message. ``unpack`` reverses it. Values may be NaN, for a broken
    wire; a block without rows or columns is refused by the receiver.
    """
    return HEADER.pack(SAMPLES, block.columns, block.rows, block.handle, block.index, block.time_s) + block.content


def pack_estimates(block: EstimateBlock) -> bytes:
    """Pack one block of estimates as the bytes of a frame, padded to a multiple of eight bytes.

    The service sends these; a client needs only ``unpack``. The header is followed by friction, lower and upper bound
    [N] of every row, then by their flags.
    """
    rows = len(block.flag_bytes) // FLAG_BYTES
    head = HEADER.pack(ESTIMATES, NEWTONS, rows, block.handle, block.index, block.time_s)
    return head + block.newton_bytes + block.flag_bytes + bytes(FLAG_BYTES * (rows % 2))


def pack_acknowledgement(block: Acknowledgement) -> bytes:
    """Pack one acknowledgement as the bytes of a frame: a header alone.

    The service sends it once the journal holds the samples, about once a second; a client needs only ``unpack``.
    """
    return HEADER.pack(ACKNOWLEDGEMENT, 0, 0, block.handle, block.index, 0.0)


@lru_cache(64)
def layouts(columns: int, rows: int) -> tuple[np.dtype[np.void], np.dtype[np.void]]:
    """Describe a frame of samples and one of estimates. ``place``: kind, columns, rows and handle, then the index."""
    head: list[Any] = [("place", "<u8", 2), ("time_s", "<f8")]
    estimates = [("newtons", f"V{ROW_BYTES * rows}"), ("flags", f"V{FLAG_BYTES * rows}")]
    padding = [("padding", f"V{FLAG_BYTES}")] if rows % 2 else []
    return np.dtype([*head, ("samples", f"V{8 * columns * rows}")]), np.dtype([*head, *estimates, *padding])


def unpack(message: bytes) -> list[SampleBlock | EstimateBlock | Acknowledgement]:
    """Read the blocks of a message: samples, estimates or acknowledgements, in their order.

    Raises ``FrameError`` for an empty message, a cut block, or a block of an unknown kind; then no block of the message
    counts.
    """
    blocks: list[SampleBlock | EstimateBlock | Acknowledgement] = []
    at, end = 0, len(message)
    if not end:
        raise FrameError("got an empty message; expected one block at least")
    while at < end:
        if end - at < HEADER.size:
            raise FrameError(f"byte {at}: {end - at} bytes are left, expected a header of {HEADER.size}")
        kind, columns, rows, handle, index, time_s = HEADER.unpack_from(message, at)
        samples = kind == SAMPLES and rows and columns
        size = 8 * rows * columns if samples else _size(kind, columns, rows, at)
        at += HEADER.size
        if index + rows > LARGEST_INDEX:
            raise FrameError(f"byte {at}: index {index} is beyond 2^53")
        if end - at < size:
            raise FrameError(f"byte {at}: {end - at} bytes are left, expected {size} for {rows} rows")
        if samples:
            blocks.append(SampleBlock(handle, index, time_s, message[at : at + size], columns))
        elif kind == ESTIMATES:
            flags_at = at + ROW_BYTES * rows
            newtons, flags = message[at:flags_at], message[flags_at : flags_at + FLAG_BYTES * rows]
            blocks.append(EstimateBlock(handle, index, time_s, newtons, flags))
        else:
            blocks.append(Acknowledgement(handle, index))
        at += size
    return blocks


def _size(kind: int, columns: int, rows: int, at: int) -> int:
    """Count the bytes behind a header that is not of samples."""
    if kind == ESTIMATES and rows and columns == NEWTONS:
        return ROW_BYTES * rows + FLAG_BYTES * (rows + rows % 2)
    if kind == ACKNOWLEDGEMENT and not rows and not columns:
        return 0
    raise FrameError(f"byte {at}: got kind {kind} with {columns} columns and {rows} rows, expected no such block")
