"""MATLAB files: version 5 (``save -v6`` and ``-v7``) through SciPy, version 7.3 as the HDF5 that it is."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.recordings.formats.format import Format, Library
from cylinder_friction.recordings.formats.hdf5 import SIGNATURE
from cylinder_friction.recordings.formats.logged_table import (
    Channel,
    Found,
    LoggedTable,
    column_arrays,
    numeric,
    tables_by_length,
)
from cylinder_friction.recordings.formats.source import FileSource

_DEEPEST = 20
_LONGEST_TEXT = 4096
_MOST_ENTRIES = 1000


@dataclass(frozen=True)
class Leaf:
    """An array of a file, read when it is asked for; ``shape`` as MATLAB shows it."""

    shape: tuple[int, ...]
    kind: str
    read: Callable[[], NDArray[Any]]


def walk(name: str, value: Any, found: Found, unit: str = "", depth: int = 0) -> None:
    """Add to ``found`` what a variable holds.

    Args:
        name: Of the variable, or the path to the field: ``log.P1``; ``log_2.P1`` within an array of structs.
        value: A ``Leaf``, a mapping (struct), a list (array of structs, cell array), or anything else (no channel).
    """
    if depth > _DEEPEST:
        found.others.append(name)
    elif isinstance(value, Leaf):
        arrays = column_arrays(name, value.shape) if value.kind in "biuf" else []
        if not arrays:
            found.others.append(name)
        found.channels += [Channel(path, length, partial(_values, value, at), unit) for path, length, at in arrays]
    elif isinstance(value, dict):
        walk_struct(name, value, found, unit, depth)
    elif isinstance(value, list):
        for index, entry in enumerate(value, start=1):
            walk(f"{name}_{index}", entry, found, unit, depth + 1)
    else:
        found.others.append(name)


def walk_struct(name: str, struct: Mapping[str, Any], found: Found, unit: str = "", depth: int = 0) -> None:
    """Add a struct's fields, or the variables of a file (name '').

    A text field ``unit`` or ``units`` states the unit of the struct's arrays; a struct ``units`` of texts states it
    for the fields it names.
    """
    if "signals" in struct and isinstance(struct["signals"], dict | list):
        _walk_simulink(name, struct, found, depth)
        return
    stated_name, data = struct.get("Name"), struct.get("Data")
    if isinstance(stated_name, str) and isinstance(data, Leaf):  # as dSPACE writes X and Y(k)
        path, of_data = stated_name.strip(), struct.get("Unit", unit)
        taken = any((each.name, each.length) == (path, max(data.shape, default=0)) for each in found.channels)
        walk(f"{name}.{path}" if taken else path, data, found, of_data if isinstance(of_data, str) else "", depth + 1)
        return
    stated = next((struct[key] for key in ("unit", "units", "Unit", "Units") if key in struct), None)
    for key, value in struct.items():
        if value is stated and key.casefold() in ("unit", "units") and isinstance(stated, dict | str):
            continue
        of_key = stated.get(key) if isinstance(stated, dict) else stated
        path = f"{name}.{key}" if name else key
        walk(path, value, found, of_key if isinstance(of_key, str) else unit, depth + 1)


def _walk_simulink(name: str, struct: Mapping[str, Any], found: Found, depth: int) -> None:
    """Add Simulink's 'structure with time': time, and signals with values and a label each."""
    signals = struct["signals"] if isinstance(struct["signals"], list) else [struct["signals"]]
    prefix = f"{name}." if name else ""
    if "time" in struct:
        walk(f"{prefix}time", struct["time"], found, "s", depth + 1)
    for index, signal in enumerate(signals, start=1):
        if not isinstance(signal, dict) or "values" not in signal:
            found.others.append(f"{prefix}signals_{index}")
            continue
        label = signal.get("label")
        label = label.strip() if isinstance(label, str) else ""
        values = signal["values"]
        if isinstance(values, Leaf) and len(values.shape) == 3:
            # Matrices, one per sample along the last axis, become one row per sample.
            size, samples, read = values.shape[0] * values.shape[1], values.shape[2], values.read
            values = Leaf((samples, size), values.kind, partial(_samples_first, read, size, samples))
        walk(f"{prefix}{label or f'signals_{index}'}", values, found, "", depth + 1)


def _samples_first(read: Callable[[], NDArray[Any]], size: int, samples: int) -> NDArray[Any]:
    return read().reshape(size, samples).T


def _values(leaf: Leaf, at: Any) -> NDArray[Any]:
    return np.ascontiguousarray(numeric(leaf.read()[at].reshape(-1)))


def read_matlab(source: FileSource, wanted: Collection[str] | None) -> list[LoggedTable]:
    """Return the file's vectors, matrices and structs as channels; those of one length share a table.

    Single values and text are no channels and only named, as ``unread``. So are variables that nothing wanted can come
    from: they are not loaded.
    """
    found = Found()
    listed = _listed(source)
    names = None if listed is None or wanted is None else _to_load(listed, wanted, found)
    handle: Any = source.handle()
    import scipy.io  # scipy.io: only MATLAB files need it

    content = scipy.io.loadmat(handle, simplify_cells=True, variable_names=names, verify_compressed_data_integrity=True)
    variables = {name: _tree(value) for name, value in content.items() if not name.startswith("__")}
    if "None" in variables:  # SciPy's name for objects; the last one is left
        variables[_object_name(content["None"])] = variables.pop("None")
    walk_struct("", variables, found)
    return tables_by_length(found, wanted, ".")


def _listed(source: FileSource) -> list[tuple[str, tuple[int, ...], str]] | None:
    """Return name, shape and class of each variable; None if SciPy cannot list them beside a string, date or table."""
    import scipy.io

    handle: Any = source.handle()
    try:
        return list(scipy.io.whosmat(handle))
    except TypeError:
        return None


def _object_name(value: Any) -> str:
    try:
        return f"{value['s0'][0].decode()} ({value['s2'][0].decode()})"
    except (AttributeError, IndexError, ValueError, UnicodeDecodeError):
        return "an object"


def _to_load(listed: list[tuple[str, tuple[int, ...], str]], wanted: Collection[str], found: Found) -> list[str]:
    """Return the variables that wanted channels may come from; the others are noted as found."""
    kept = []
    for name, _, kind in listed:
        origin = (f"{name}.", f"{name}_")
        unit = name.casefold() in ("unit", "units")
        if unit or kind == "struct" or any(f"{want}.".startswith(origin) for want in wanted):
            kept.append(name)
        else:
            found.others.append(name)
    return kept


def _tree(value: Any) -> Any:
    """Return a variable as SciPy gives it in the shape that the walk expects."""
    if isinstance(value, dict):
        return {str(key): _tree(entry) for key, entry in value.items()}
    if isinstance(value, np.ndarray) and value.dtype == object:
        return [_tree(entry) for entry in value.reshape(-1)]
    if isinstance(value, list | tuple):
        return [_tree(entry) for entry in value]
    if isinstance(value, np.ndarray):
        return Leaf(value.shape, value.dtype.kind, lambda: value)
    return value


def read_matlab73(source: FileSource, wanted: Collection[str] | None) -> list[LoggedTable]:
    """Return a file's channels as ``read_matlab`` does."""
    import h5py

    with h5py.File(source.handle(), "r") as file:
        found = Found()
        variables = {name: _tree73(file[name], 0) for name in file if not name.startswith("#")}
        walk_struct("", variables, found)
        _add_table73(file, found)
        return tables_by_length(found, wanted, ".")


def _tree73(node: Any, depth: int) -> Any:
    """Return an object of the file in the shape that the walk expects: Leaf, dict, list or text."""
    import h5py

    if depth > _DEEPEST:
        return None
    if isinstance(node, h5py.Group):
        fields = {name: _tree73(node[name], depth + 1) for name in node}
        return _struct_array(fields)
    matlab_class = node.attrs.get("MATLAB_class", b"")
    matlab_class = matlab_class.decode(errors="replace") if isinstance(matlab_class, bytes) else str(matlab_class)
    if "MATLAB_empty" in node.attrs or "MATLAB_object_decode" in node.attrs or node.shape is None:
        return None
    if h5py.check_ref_dtype(node.dtype) is not None:
        if node.size > _MOST_ENTRIES:
            return None
        file = node.file
        return _References(_tree73(file[reference], depth + 1) for reference in node[()].T.reshape(-1))
    if matlab_class == "char":
        if node.size > _LONGEST_TEXT:
            return None
        return "".join(chr(code) for code in node[()].T.reshape(-1))
    if matlab_class == "function_handle":
        return None
    return Leaf(node.shape[::-1], node.dtype.kind, lambda: node[()].T)


def _add_table73(file: Any, found: Found) -> None:
    """Add the columns of a file's one table or timetable, and the timetable's row times if they are durations."""
    hidden = file.get("#refs#", {})
    tables = [hidden[name] for name in hidden if {"data", "varNames"} <= set(getattr(hidden[name], "keys", set)())]
    if len(tables) != 1:
        return
    names, columns = (_tree73(tables[0][key], 0) for key in ("varNames", "data"))
    if not isinstance(names, list) or not isinstance(columns, list):
        return
    rows = max((max(each.shape) for each in columns if isinstance(each, Leaf)), default=0)
    own = {file[reference].name for reference in tables[0]["data"][()].reshape(-1)}
    objects = [file[reference] for reference in file["#subsystem#/MCOS"][()].reshape(-1)]
    times = [each for each in objects if each.name not in own and _rows(each) == rows > 1]
    if "rowTimes" in tables[0] and len(times) == 1:
        walk("Time", _tree73(times[0], 0), found, "ms")
    for name, column in zip(names, columns, strict=False):
        walk(str(name), column, found)


def _rows(node: Any) -> int:
    """Return the length of a vector of floating-point numbers; 0 for anything else."""
    dtype = getattr(node, "dtype", None)
    return int(node.size) if dtype is not None and dtype.kind == "f" and max(node.shape) == node.size else 0


class _References(list[Any]):
    """What a dataset of references points to: a cell array, or one field of an array of structs."""


def _struct_array(fields: dict[str, Any]) -> Any:
    """Return a struct; or, where every field is references of one number, the array of structs that they make."""
    lengths = {len(value) if isinstance(value, _References) else -1 for value in fields.values()}
    if len(lengths) == 1 and min(lengths) > 0:
        return [{key: value[index] for key, value in fields.items()} for index in range(lengths.pop())]
    return fields


FORMAT = Format(
    "matlab", "a MATLAB file", read_matlab, starts=(b"MATLAB 5.0 MAT-file",), crashes="SciPy's MATLAB reader"
)
FORMAT_73 = Format(
    "matlab73",
    "a MATLAB file",
    read_matlab73,
    starts=(b"MATLAB 7.3 MAT-file",),
    fits=lambda head: head[512:].startswith(SIGNATURE),
    setting="matlab",
    needs=Library("h5py", "MATLAB 7.3", "hdf5"),
    crashes="the HDF5 library",
)
