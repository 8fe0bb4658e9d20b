"""Estimators that other packages register as entry points."""

from __future__ import annotations

import hashlib
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import Any

GROUP = "cylinder_friction.estimators"
"""In ``pyproject.toml``: ``[project.entry-points."cylinder_friction.estimators"]`` with ``KIND = "MODULE:CLASS"``."""


def own_kinds() -> dict[str, EntryPoint]:
    """Find the entry points of installed packages, by their kind of estimator, sorted."""
    return {each.name: each for each in sorted(entry_points(group=GROUP), key=lambda each: each.name)}


def own_class(entry: EntryPoint) -> Any:
    """Import the class that an entry point names.

    Raises:
        ValueError: It cannot be imported, or its kind is not the entry point's name.
    """
    where = f"entry point {entry.name} = {entry.value} in the group {GROUP}"
    try:
        found = entry.load()
    except (ImportError, AttributeError) as error:
        raise ValueError(f"{where}: {error}; correct it, or uninstall its package") from error
    if getattr(found, "kind", None) != entry.name:
        got = getattr(found, "kind", None)
        raise ValueError(f"{where}: the kind of the class is {got!r}; expected the entry point's name")
    return found


def own_code() -> str:
    """List the registered kinds with the hashes of their modules' files; empty if there are none."""
    return "".join(f" {name}:{_hash_of(each.module)}" for name, each in own_kinds().items())


def _hash_of(module: str) -> str:
    spec = find_spec(module)
    if spec is None or spec.origin is None:
        return "missing"
    return hashlib.sha256(Path(spec.origin).read_bytes()).hexdigest()
