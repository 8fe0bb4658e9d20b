"""Who takes part: one module a family, each with its ``ENTRIES``."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from friction_benchmark.roster.entry import RosterEntry

MODULES = tuple(
    f"{__name__}.{family}" for family in ("floors", "analytical", "related_work", "regression", "networks", "twin")
)
"""In the order of tables."""


def roster(modules: Sequence[str] = MODULES) -> dict[str, RosterEntry]:
    """Return the participants of these modules by name, in order.

    Raises:
        ValueError: Two have one name.
    """
    found: dict[str, RosterEntry] = {}
    for module in modules:
        if find_spec(module) is None:
            continue
        for entry in import_module(module).ENTRIES:
            if entry.name in found:
                raise ValueError(f"roster: two participants are called {entry.name!r}; the second is in {module}")
            found[entry.name] = entry
    return found
