"""Print the groups of modules that import each other, by whatever means, and their number; none may be left.

``python tools/import_cycles.py [SOURCE ...]``: folders that hold packages, by default this project's ``src``.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from graphlib import CycleError, TopologicalSorter
from itertools import pairwise
from pathlib import Path

from cylinder_friction.import_graph import PACKAGES, all_modules, imported_modules


def cycles(packages: Mapping[str, Path]) -> list[list[str]]:
    """Return cycles of imports, those in functions and for type checking included; no two share an import."""
    graph = {module: imported_modules(module, packages, type_checking=True) for module in all_modules(packages)}
    found = []
    while True:
        try:
            TopologicalSorter(graph).prepare()
        except CycleError as error:
            cycle = list(error.args[1])
            found.append(cycle)
            for imported, importing in pairwise(cycle):
                graph[importing].discard(imported)
        else:
            return found


def main(sources: list[str]) -> int:
    given = {package.parent.name: Path(source) for source in sources for package in Path(source).glob("*/__init__.py")}
    found = cycles(given or PACKAGES)
    for cycle in found:
        print(" <- ".join(cycle))
    print(f"{len(found)} cycles of imports")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
