"""HDF5: datasets by their path, compound datasets as tables."""

from collections.abc import Collection
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.recordings.formats.format import Format, Library
from cylinder_friction.recordings.formats.logged_table import (
    Channel,
    Found,
    LoggedTable,
    column_arrays,
    numeric,
    table_of,
    tables_by_length,
)
from cylinder_friction.recordings.formats.source import FileSource

_RATES = ("sampling_rate", "sample_rate", "samplerate", "sampling_frequency", "sample_rate_hz", "fs", "rate")
_STEPS = ("dt", "sample_time", "sample_time_s", "sampling_time", "sampling_interval", "sample_interval", "wf_increment")


def read_hdf5(source: FileSource, wanted: Collection[str] | None) -> list[LoggedTable]:
    """Return one table per compound dataset, and one for all other datasets of equal length.

    A dataset's name is its path, ``pressures/P1``. Units come from its attribute ``unit`` or ``units``. Where a
    dataset, its group or the file states a sampling rate [Hz] or a sample time [s] as an attribute and there is no time
    among the channels, a channel ``time`` is made of it.
    """
    import h5py

    with h5py.File(source.handle(), "r") as file:
        found, tables = Found(), []

        def visit(path: str, node: Any) -> None:
            if not isinstance(node, h5py.Dataset):
                return
            if node.dtype.names and node.shape is not None and len(node.shape) == 1 and node.shape[0] > 0:
                tables.append(table_of(_fields(node), wanted, path))
            else:
                _add(path, node, found)

        file.visititems(visit)
        if found.channels or not tables:
            tables += tables_by_length(found, wanted, "/")
        return tables


def _add(path: str, node: Any, found: Found) -> None:
    import h5py

    text = h5py.check_string_dtype(node.dtype) is not None
    shape = node.shape or ()
    arrays = column_arrays(path, shape) if shape and (text or node.dtype.kind in "biuf") else []
    if not arrays or (text and len(arrays) > 1):
        found.others.append(path)
        return
    unit, sample_time_s = _unit(node.attrs), _sample_time_s(node)

    def read(at: Any) -> NDArray[Any]:
        if text:
            return np.asarray(node.asstr(errors="replace")[at]).reshape(-1)
        return numeric(np.ascontiguousarray(node[at].reshape(-1)))

    found.channels += [Channel(name, length, partial(read, at), unit, sample_time_s) for name, length, at in arrays]


def _fields(node: Any) -> list[Channel]:
    """Return the columns of a compound dataset. A field that is an array gives one channel per entry."""

    def read(name: str, at: Any) -> NDArray[Any]:
        return numeric(np.ascontiguousarray(node.fields(name)[()][at]))

    channels = []
    for name in node.dtype.names:
        dtype = node.dtype[name]
        base, shape = dtype.subdtype or (dtype, ())
        if base.kind not in "biuf" or len(shape) > 1:
            continue
        for index in range(shape[0] if shape else 1):
            path = f"{name}_{index + 1}" if shape else name
            at = (slice(None), index) if shape else ()
            channels.append(Channel(path, node.shape[0], partial(read, name, at)))
    return channels


def _unit(attributes: Any) -> str:
    stated = [attributes.get(key) for key in ("unit", "units", "Unit", "Units")]
    texts = [each.decode(errors="replace") if isinstance(each, bytes) else each for each in stated]
    return next((text.strip() for text in texts if isinstance(text, str)), "")


def _sample_time_s(node: Any) -> float | None:
    """Return the sample time that the dataset states, or the nearest group around it."""
    while True:
        attributes = {key.casefold(): node.attrs[key] for key in node.attrs if key.casefold() in (*_RATES, *_STEPS)}
        for key, value in attributes.items():
            if np.ndim(value) == 0 and np.issubdtype(np.asarray(value).dtype, np.number) and value > 0:
                stated = float(value)
                return 1.0 / stated if key in _RATES else stated
        if node.name == "/":
            return None
        node = node.parent


SIGNATURE = b"\x89HDF\r\n\x1a\n"


def _has_signature(head: bytes) -> bool:
    """Look for the signature, also behind a user's block of 512 bytes or a power of two times that."""
    return any(head[offset:].startswith(SIGNATURE) for offset in (0, 512, 1024, 2048, 4096, 8192))


LIBRARY = Library("h5py", "HDF5", "hdf5")
FORMAT = Format("hdf5", "an HDF5 file", read_hdf5, fits=_has_signature, needs=LIBRARY, crashes="the HDF5 library")
