"""Read MATLAB files: version 5 (``save -v6`` and ``-v7``) with SciPy, version 7.3 as HDF5."""

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from cylinder_friction.recordings.formats import hdf5
from cylinder_friction.recordings.formats.channels import (
    Found,
    channels_of,
    factors_among,
    stated_start,
    tables_by_length,
)
from cylinder_friction.recordings.formats.format import FileSource, Format, LoggedTable

VERSION_5 = b"MATLAB 5.0 MAT-file"


def walk(name: str, value: Any, found: Found, unit: str = "") -> None:
    """Add the channels of an array, a struct or a list (array of structs, cell array), by its path, to ``found``."""
    if isinstance(value, dict):
        walk_struct(name, value, found, unit)
    elif isinstance(value, list):
        for index, entry in enumerate(value, start=1):
            walk(f"{name}_{index}", entry, found, unit)
    elif isinstance(value, np.ndarray) and value.dtype.kind in "biuf" and (own := channels_of(name, value, unit)):
        found.channels += own
    else:
        found.others.append(name)


def walk_struct(name: str, struct: Mapping[str, Any], found: Found, unit: str = "") -> None:
    """Add the fields of a struct, or a file's variables (name ''), with the unit, rate and start that fields state."""
    path = f"{name}." if name else ""
    if isinstance(signals := struct.get("signals"), dict | list):
        walk(f"{path}time", struct.get("time"), found, "s")
        listed = [each for each in (signals if isinstance(signals, list) else [signals]) if isinstance(each, dict)]
        for index, signal in enumerate(listed, start=1):
            label = signal.get("label")
            label = label.strip() if isinstance(label, str) else ""
            walk(f"{path}{label or f'signals_{index}'}", signal.get("values"), found)
        return
    stated = next((struct[key] for key in ("unit", "units", "Unit", "Units") if key in struct), None)
    if name and not isinstance(stated, dict) and (factors := factors_among(struct)):
        unit, stated = f"{stated or unit}{factors}", None
    called, data = struct.get("Name"), struct.get("Data")
    if isinstance(called, str) and isinstance(data, np.ndarray):
        called = called.strip()
        taken = any(each.name == called and each.length == len(data) for each in found.channels)
        walk(f"{path}{called}" if taken else called, data, found, stated if isinstance(stated, str) else unit)
        return
    begin, step_s = len(found.channels), hdf5.stated_step(struct)
    for key, value in struct.items():
        if value is stated and isinstance(stated, dict | str):
            continue
        own = stated.get(key) if isinstance(stated, dict) else stated
        walk(f"{path}{key}", value, found, own if isinstance(own, str) else unit)
    if step_s:
        own = {"sample_time_s": step_s, "begin": stated_start(struct)}
        found.channels[begin:] = [
            each if each.sample_time_s else replace(each, **own) for each in found.channels[begin:]
        ]


def read_matlab(source: FileSource, wanted: Collection[str] | None) -> list[LoggedTable]:
    """Read the file's vectors, matrices and structs as channels; those of one length share a table."""
    found = Found()
    if source.head.startswith(VERSION_5):
        import scipy.io  # only MATLAB files need it

        handle: Any = source.handle()
        content = scipy.io.loadmat(handle, simplify_cells=True, verify_compressed_data_integrity=True)
        if "None" in content:  # SciPy names every object so; only the last one is kept
            content["an object"] = content.pop("None")
        walk_struct("", {name: _tree(value) for name, value in content.items() if not name.startswith("__")}, found)
    else:
        replace(hdf5.FORMAT, what="a MATLAB 7.3 file").refuse_missing_library()
        import h5py

        with h5py.File(source.handle(), "r") as file:
            walk_struct("", {name: _tree73(file[name]) for name in file if not name.startswith("#")}, found)
            _add_table73(file, found)
    return tables_by_length(found, wanted, ".")


def _tree(value: Any) -> Any:
    """Convert a variable from SciPy to the types that ``walk`` expects."""
    if isinstance(value, dict):
        return {str(key): _tree(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple) or (isinstance(value, np.ndarray) and value.dtype == object):
        return [_tree(entry) for entry in np.ravel(np.array(value, dtype=object))]
    return value


class _References(list[Any]):
    """The objects that a dataset of references points to: a cell array, or one field of an array of structs."""


def _tree73(node: Any) -> Any:
    """Read an object of the file as a type that ``walk`` expects: array, dict, list or text."""
    import h5py

    if isinstance(node, h5py.Group):
        fields = {name: _tree73(node[name]) for name in node}
        lengths = {len(value) if isinstance(value, _References) else -1 for value in fields.values()}
        if len(lengths) == 1 and min(lengths) > 0:  # all fields have equally many references: an array of structs
            return [{key: value[index] for key, value in fields.items()} for index in range(lengths.pop())]
        return fields
    if "MATLAB_empty" in node.attrs or "MATLAB_object_decode" in node.attrs or node.shape is None:
        return None
    values = node[()].T
    if h5py.check_ref_dtype(node.dtype) is not None:
        return _References(_tree73(node.file[reference]) for reference in values.reshape(-1))
    of_class = node.attrs.get("MATLAB_class", b"")
    return "".join(map(chr, values.reshape(-1))) if of_class in (b"char", "char") else values


def _add_table73(file: Any, found: Found) -> None:
    """Add the columns of a file's only table or timetable, and a timetable's row times if they are durations."""
    hidden = file.get("#refs#", {})
    tables = [hidden[name] for name in hidden if {"data", "varNames"} <= set(getattr(hidden[name], "keys", set)())]
    if len(tables) != 1:
        return
    names, columns = (_tree73(tables[0][key]) for key in ("varNames", "data"))
    rows = max((max(each.shape) for each in columns if isinstance(each, np.ndarray)), default=0)
    own = {file[reference].name for reference in tables[0]["data"][()].reshape(-1)}
    objects = [file[reference] for reference in file["#subsystem#/MCOS"][()].reshape(-1)]
    times = [each for each in objects if each.name not in own and _rows(each) == rows > 1]
    if "rowTimes" in tables[0] and len(times) == 1:
        walk("Time", _tree73(times[0]), found, "ms")
    for name, column in zip(names, columns, strict=False):
        walk(str(name), column, found)


def _rows(node: Any) -> int:
    """Return the length of a vector of floating-point numbers; 0 for anything else."""
    dtype = getattr(node, "dtype", None)
    return int(node.size) if dtype is not None and dtype.kind == "f" and max(node.shape) == node.size else 0


FORMAT = Format(
    "matlab",
    "a MATLAB file",
    read_matlab,
    starts=(VERSION_5, b"MATLAB 7.3 MAT-file"),
    fits=lambda head: head[512:].startswith(hdf5.SIGNATURE),
    crashes="the MATLAB reader",
)
