"""Print lines and modules of Python per package: ``python tools/sizes.py [FOLDER]``, by default ``src``."""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path


def main(root: Path) -> None:
    """Print one line per package and subpackage, largest first."""
    lines: Counter[str] = Counter()
    modules: Counter[str] = Counter()
    for path in root.rglob("*.py"):
        parts = path.relative_to(root).parts
        for package in {parts[0], "/".join(parts[:2]) if len(parts) > 2 else parts[0]}:
            lines[package] += len(path.read_text(encoding="utf-8").splitlines())
            modules[package] += 1
    for package, count in lines.most_common():
        sys.stdout.write(f"{count:>7,} lines {modules[package]:>4} modules  {package}\n")


if __name__ == "__main__":
    main(Path(*sys.argv[1:2] or ["src"]))
