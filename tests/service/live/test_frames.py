"""Frames survive the way, and what is none is refused as a whole."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cylinder_friction.service.live.frames import (
    HEADER,
    SAMPLES,
    Acknowledgement,
    EstimateBlock,
    FrameError,
    SampleBlock,
    pack_acknowledgement,
    pack_estimates,
    pack_samples,
    unpack,
)


@given(rows=st.integers(1, 7), columns=st.integers(1, 5), handle=st.integers(0, 2**32 - 1), index=st.integers(0, 2**52))
def test_blocks_of_one_message_come_back(rows: int, columns: int, handle: int, index: int) -> None:
    numbers = np.arange(rows * columns, dtype=np.float64).reshape(rows, columns)
    numbers[0, 0] = np.nan
    newtons = np.arange(3.0 * rows).reshape(rows, 3)
    sent = [
        pack_samples(SampleBlock(handle, index, 1.5, numbers)),
        pack_estimates(EstimateBlock.of(handle, index, 2.5, newtons, np.arange(rows, dtype=np.uint32))),
        pack_acknowledgement(Acknowledgement(handle, index)),
    ]
    samples, estimates, acknowledged = unpack(b"".join(sent))
    assert isinstance(samples, SampleBlock)
    assert isinstance(estimates, EstimateBlock)
    assert (samples.handle, samples.index, samples.time_s) == (handle, index, 1.5)
    np.testing.assert_array_equal(samples.samples, numbers)
    np.testing.assert_array_equal(estimates.newtons, newtons)
    assert estimates.flags.tolist() == list(range(rows))
    assert acknowledged == Acknowledgement(handle, index)
    assert all(len(each) % 8 == 0 for each in sent)


@given(st.binary(max_size=200))
def test_garbage_is_refused_or_is_blocks(message: bytes) -> None:
    try:
        blocks = unpack(message)
    except FrameError as error:
        assert "expected" in str(error) or "beyond" in str(error)  # noqa: PT017 - either outcome is right
    else:
        assert blocks


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (b"", "empty message"),
        (b"\x01", "1 bytes are left, expected a header of 24"),
        (HEADER.pack(SAMPLES, 3, 2, 1, 0, 0.0) + bytes(40), "40 bytes are left, expected 48 for 2 rows"),
        (HEADER.pack(9, 3, 2, 1, 0, 0.0), "got kind 9"),
        (HEADER.pack(SAMPLES, 3, 0, 1, 0, 0.0), "3 columns and 0 rows"),
        (HEADER.pack(SAMPLES, 1, 1, 1, 1 << 60, 0.0) + bytes(8), "beyond 2"),
    ],
)
def test_what_is_no_frame_is_named(message: bytes, words: str) -> None:
    with pytest.raises(FrameError, match=words):
        unpack(message)
