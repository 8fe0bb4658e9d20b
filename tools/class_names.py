"""Print the classes of the product that share a name; no name may stand twice: ``python tools/class_names.py``."""

from __future__ import annotations

import ast
import sys
from collections import defaultdict
from pathlib import Path

SOURCE = Path(__file__).parents[1] / "src"


def main() -> int:
    """Print each name that stands twice with its places; return 1 if there is one."""
    places: dict[str, list[str]] = defaultdict(list)
    for path in sorted(SOURCE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef):
                places[node.name].append(path.relative_to(SOURCE).as_posix())
    twice = {name: found for name, found in places.items() if len(found) > 1}
    for name, found in sorted(twice.items()):
        print(f"{name}: {', '.join(found)}")
    print(f"{len(twice)} class names stand twice")
    return 1 if twice else 0


if __name__ == "__main__":
    sys.exit(main())
