"""MATLAB 7.3: HDF5 with axes the other way round, structs as groups, and references for cells."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from cylinder_friction.recordings.formats.channels import Found, tables_by_length
from cylinder_friction.recordings.formats.hdf5 import refuse_absurd_size
from cylinder_friction.recordings.formats.libraries import optional_library
from cylinder_friction.recordings.formats.matlab_tree import Leaf, walk_struct

if TYPE_CHECKING:
    from collections.abc import Collection

    from cylinder_friction.recordings.formats.logged_table import LoggedTable
    from cylinder_friction.recordings.formats.source import FileSource

_LONGEST_TEXT = 4096
_MOST_ENTRIES = 1000
_DEEPEST = 20


def read_matlab73(source: FileSource, wanted: Collection[str] | None) -> list[LoggedTable]:
    """Return a file's channels as ``read_matlab`` does.

    Raises:
        RecordingError: h5py is not installed.
    """
    h5py = optional_library("h5py", "MATLAB 7.3", "hdf5")
    with h5py.File(source.handle(), "r") as file:
        found = Found()
        variables = {name: _tree(file[name], source, 0) for name in file if not name.startswith("#")}
        walk_struct("", variables, found)
        return tables_by_length(found, wanted, ".")


def _tree(node: Any, source: FileSource, depth: int) -> Any:
    """Return an object of the file in the shape that the walk expects: Leaf, dict, list or text."""
    h5py = optional_library("h5py", "MATLAB 7.3", "hdf5")
    if depth > _DEEPEST:
        return None
    if isinstance(node, h5py.Group):
        fields = {name: _tree(node[name], source, depth + 1) for name in node}
        return _struct_array(fields)
    matlab_class = node.attrs.get("MATLAB_class", b"")
    matlab_class = matlab_class.decode(errors="replace") if isinstance(matlab_class, bytes) else str(matlab_class)
    if "MATLAB_empty" in node.attrs or node.shape is None:
        return None
    if h5py.check_ref_dtype(node.dtype) is not None:
        if node.size > _MOST_ENTRIES:
            return None
        file = node.file
        return _References(_tree(file[reference], source, depth + 1) for reference in node[()].T.reshape(-1))
    if matlab_class == "char":
        if node.size > _LONGEST_TEXT:
            return None
        return "".join(chr(code) for code in node[()].T.reshape(-1))
    if matlab_class == "function_handle":
        return None
    refuse_absurd_size(node, source)
    return Leaf(node.shape[::-1], node.dtype.kind, lambda: node[()].T)


class _References(list[Any]):
    """What a dataset of references points to: a cell array, or one field of an array of structs."""


def _struct_array(fields: dict[str, Any]) -> Any:
    """Return a struct; or, where every field is references of one number, the array of structs that they make."""
    lengths = {len(value) if isinstance(value, _References) else -1 for value in fields.values()}
    if len(lengths) == 1 and min(lengths) > 0:
        return [{key: value[index] for key, value in fields.items()} for index in range(lengths.pop())]
    return fields
