"""Print the groups of modules that import each other, by whatever means, and their number; none may be left."""

from __future__ import annotations

import sys
from graphlib import CycleError, TopologicalSorter
from itertools import pairwise

from cylinder_friction.import_graph import all_modules, imported_modules


def cycles() -> list[list[str]]:
    """Return cycles of imports, those in functions and for type checking included; no two share an import."""
    graph = {module: imported_modules(module, type_checking=True) for module in all_modules()}
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


def main() -> int:
    found = cycles()
    for cycle in found:
        print(" <- ".join(cycle))
    print(f"{len(found)} cycles of imports")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
