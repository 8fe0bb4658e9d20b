"""Read HDF5 files: datasets as channels named by their paths, compound datasets as tables."""

from collections.abc import Collection, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from cylinder_friction.recordings.formats.channels import (
    Channel,
    Found,
    channels_of,
    flat,
    stated_start,
    table_of,
    tables_by_length,
    unit_among,
)
from cylinder_friction.recordings.formats.format import FileSource, Format, LoggedTable

_RATES = ("sampling_rate", "sample_rate", "samplerate", "sampling_frequency", "sample_rate_hz", "fs", "rate")
_STEPS = ("dt", "sample_time", "sample_time_s", "sampling_time", "sampling_interval", "sample_interval", "wf_increment")


def read_hdf5(source: FileSource, wanted: Collection[str] | None) -> list[LoggedTable]:
    """Read a table per compound dataset, and of other datasets of one length or rate, named by their paths."""
    import h5py

    with h5py.File(source.handle(), "r") as file:
        found, tables = Found(), []

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
                begin = stated_start(node.attrs)
                found.channels += [replace(each, unit=unit, sample_time_s=step_s, begin=begin) for each in channels]
            else:
                found.others.append(path)

        file.visititems(visit)
        if found.channels or not tables:
            tables += tables_by_length(found, wanted, "/")
        return tables


def _sample_time_s(node: Any) -> float | None:
    """Find the sample time that the dataset states, or the nearest group around it."""
    while (step_s := stated_step(node.attrs)) is None and node.name != "/":
        node = node.parent
    return step_s


def stated_step(properties: Mapping[str, Any]) -> float | None:
    """Read a sample time [s] among properties, or a rate [Hz] as one; None without one."""
    for key, value in properties.items():
        name = key.casefold()
        if name in (*_RATES, *_STEPS) and np.size(value) == 1 and np.asarray(value).dtype.kind in "iuf":
            number = float(np.asarray(value).reshape(-1)[0])
            return (1.0 / number if name in _RATES else number) if number > 0.0 else None
    return None


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
