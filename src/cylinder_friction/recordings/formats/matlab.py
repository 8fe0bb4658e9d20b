"""MATLAB files of version 5 (``save -v6`` and ``-v7``) through SciPy; version 7.3 is another reader's."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from cylinder_friction.recordings.formats.channels import Found, tables_by_length
from cylinder_friction.recordings.formats.matlab_tree import Leaf, walk_struct

if TYPE_CHECKING:
    from collections.abc import Collection

    from cylinder_friction.recordings.formats.logged_table import LoggedTable
    from cylinder_friction.recordings.formats.source import FileSource


def read_matlab(source: FileSource, wanted: Collection[str] | None) -> list[LoggedTable]:
    """Return the file's vectors, matrices and structs as channels; those of one length share a table.

    Single values and text are no channels and only named, as ``unread``. So are variables that nothing wanted can come
    from: they are not loaded.
    """
    import scipy.io

    found = Found()
    names = _to_load(source, wanted, found)
    handle: Any = source.handle()
    content = scipy.io.loadmat(handle, simplify_cells=True, variable_names=names, verify_compressed_data_integrity=True)
    variables = {name: _tree(value) for name, value in content.items() if not name.startswith("__")}
    walk_struct("", variables, found)
    return tables_by_length(found, wanted, ".")


def _to_load(source: FileSource, wanted: Collection[str] | None, found: Found) -> list[str] | None:
    """Return the variables that wanted channels may come from; the others are noted as found."""
    if wanted is None:
        return None
    kept = []
    handle: Any = source.handle()
    import scipy.io

    for name, _, _ in scipy.io.whosmat(handle):
        origin = (f"{name}.", f"{name}_")
        if name.casefold() in ("unit", "units") or any(f"{want}.".startswith(origin) for want in wanted):
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
