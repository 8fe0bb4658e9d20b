"""Read HDF5 files: datasets as channels named by their paths, compound datasets as tables."""

from collections.abc import Collection
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from cylinder_friction.recordings.formats.channels import (
    Channel,
    Found,
    channels_of,
    flat,
    table_of,
    tables_by_length,
    unit_among,
)
from cylinder_friction.recordings.formats.format import FileSource, Format, LoggedTable
from cylinder_friction.recordings.recording import RecordingError

_RATES = ("sampling_rate", "sample_rate", "samplerate", "sampling_frequency", "sample_rate_hz", "fs", "rate")
_STARTS = ("t0", "start", "start_time", "starttime", "wf_start_offset", "wf_start_time")
_STEPS = ("dt", "sample_time", "sample_time_s", "sampling_time", "sampling_interval", "sample_interval", "wf_increment")


def read_hdf5(source: FileSource, wanted: Collection[str] | None) -> list[LoggedTable]:
    """Read one table per compound dataset, and one of all other datasets of equal length.

    A dataset's name is its path, such as ``pressures/P1``. If the channels include no time, a channel ``time`` is made
    from a sampling rate [Hz] or sample time [s] that the dataset, its group or the file states as an attribute.
    """
    import h5py

    with h5py.File(source.handle(), "r") as file:
        found, tables, starts = Found(), [], dict[str, str]()

        def visit(path: str, node: Any) -> None:
            if not isinstance(node, h5py.Dataset):
                return
            shape: tuple[int, ...] = node.shape or ()
            if node.dtype.names and len(shape) == 1 and shape[0] > 0:
                fields = [name for name in node.dtype.names if node.dtype[name].kind in "biuf"]
                channels = [Channel(name, shape[0], partial(flat, node.fields(name))) for name in fields]
                tables.append(table_of(channels, wanted, path))
            elif shape and node.dtype.kind in "biuf" and (channels := channels_of(path, node)):
                unit, step_s = unit_among(node.attrs), _sample_time_s(node)
                begins = (str(value) for key, value in node.attrs.items() if key.casefold() in _STARTS)
                starts.update({path: next(begins, "0")} if step_s else {})
                found.channels += [replace(each, unit=unit, sample_time_s=step_s) for each in channels]
            else:
                found.others.append(path)

        file.visititems(visit)
        by_start = {start.removesuffix(".0"): path for path, start in starts.items()}
        if len(by_start) > 1:
            (one, first), (other, second) = list(by_start.items())[:2]
            raise RecordingError(
                f"its datasets begin at different times: {first!r} at {one}, {second!r} at {other}; expected one; "
                "write a time channel for each, or cut them to a common start"
            )
        if found.channels or not tables:
            tables += tables_by_length(found, wanted, "/")
        return tables


def _sample_time_s(node: Any) -> float | None:
    """Find the sample time that the dataset states, or the nearest group around it."""
    while True:
        for key, value in node.attrs.items():
            name = key.casefold()
            if name in (*_RATES, *_STEPS) and isinstance(value, int | float | np.number) and value > 0:
                return 1.0 / float(value) if name in _RATES else float(value)
        if node.name == "/":
            return None
        node = node.parent


SIGNATURE = b"\x89HDF\r\n\x1a\n"
# A user block of 512 bytes, or of a power of two times 512 bytes, may precede the signature.
FORMAT = Format(
    "hdf5",
    "an HDF5 file",
    read_hdf5,
    fits=lambda head: any(head[offset:].startswith(SIGNATURE) for offset in (0, 512, 1024, 2048, 4096, 8192)),
    library="h5py",
    crashes="the HDF5 library",
)
