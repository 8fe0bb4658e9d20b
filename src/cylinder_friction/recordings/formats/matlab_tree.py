"""MATLAB's variables as channels: vectors, matrices, structs, arrays of structs, Simulink's logs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from cylinder_friction.recordings.formats.channels import Channel, Found, column_arrays, numeric

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

_DEEPEST = 20


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
        found: Is added to.
        unit: Stated for the value by the struct that holds it.
        depth: Of structs within structs.
    """
    if depth > _DEEPEST:
        found.others.append(name)
    elif isinstance(value, Leaf):
        _walk_leaf(name, value, found, unit)
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
            values = _samples_last(values)
        walk(f"{prefix}{label or f'signals_{index}'}", values, found, "", depth + 1)


def _samples_last(leaf: Leaf) -> Leaf:
    """Return a signal of matrices, one per sample along the last axis, as one row per sample."""
    rows, columns, samples = leaf.shape
    return Leaf((samples, rows * columns), leaf.kind, lambda: leaf.read().reshape(rows * columns, samples).T)


def _walk_leaf(name: str, leaf: Leaf, found: Found, unit: str) -> None:
    arrays = column_arrays(name, leaf.shape) if leaf.kind in "biuf" else []
    if not arrays:
        found.others.append(name)
    for path, place in arrays:
        length = max(leaf.shape) if place is None else leaf.shape[1 - place[0]]
        found.channels.append(Channel(path, length, _reader(leaf, place), unit))


def _reader(leaf: Leaf, place: tuple[int, int] | None) -> Callable[[], NDArray[Any]]:
    def read() -> NDArray[Any]:
        values = leaf.read()
        picked = values.reshape(-1) if place is None else np.take(values, place[1], axis=place[0])
        return np.ascontiguousarray(numeric(picked))

    return read
