"""Write the drawing of the layers into docs/architecture.md: ``python tools/architecture.py --write``.

The layers come from the import rules in pyproject.toml, the words from each package's docstring. Without ``--write``
the drawing is compared with the one in the guide.
"""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
GUIDE = ROOT / "docs/architecture.md"
PACKAGE = "cylinder_friction"
WIDTH = 108
_BLOCK = re.compile(r"(?<=<!-- layers: begin -->\n).*(?=<!-- layers: end -->)", re.DOTALL)


def layers() -> list[list[str]]:
    """Return the packages of each layer, the topmost first; a layer imports only from those below it."""
    rules = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]["contracts"]
    rows = next(rule["layers"] for rule in rules if rule["type"] == "layers")
    return [[name.strip().removeprefix(f"{PACKAGE}.") for name in row.split(":")] for row in rows]


def purpose(name: str) -> str:
    """Return the first line of a package's or module's docstring."""
    place = ROOT / "src" / PACKAGE / name
    source = place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
    return (
        (ast.get_docstring(ast.parse(source.read_text(encoding="utf-8"))) or "")
        .split("\n")[0]
        .rstrip(".")
        .replace("``", "")
    )


def drawing() -> str:
    """Return the layers as boxes, one below the other."""
    name_width = max(len(name) for row in layers() for name in row) + 2
    lines = ["```text"]
    for number, row in enumerate(layers()):
        lines.append(f"{'┌' if number == 0 else '├'}{'─' * WIDTH}{'┐' if number == 0 else '┤'}")
        for name in row:
            words, room = purpose(name), WIDTH - name_width - 2
            words = words if len(words) <= room else words.partition(". ")[0]  # its first sentence
            lines.append(f"│ {name:<{name_width}}{words:<{room}} │")
    lines += [f"└{'─' * WIDTH}┘", "```", ""]
    return "\n".join(lines)


def main() -> int:
    """Write the drawing, or compare it; return 1 if it is out of date or a line does not fit."""
    text, drawn = GUIDE.read_text(encoding="utf-8"), drawing()
    long = [line for line in drawn.splitlines() if len(line) > WIDTH + 2]
    if long:
        print("\n".join(["the first line of a package's docstring is too long for the drawing:", *long]))
        return 1
    if "--write" in sys.argv:
        GUIDE.write_text(_BLOCK.sub(lambda _: drawn, text), encoding="utf-8")
    elif drawn not in text:
        print(
            "docs/architecture.md: the drawing of the layers is out of date; run `python tools/architecture.py --write`"
        )
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
