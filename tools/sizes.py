"""Print lines, lines of code and modules of every house and its tests, then of the product's packages.

``python tools/sizes.py``. Lines of code are lines without docstrings, comments, blank lines and imports.
"""

from __future__ import annotations

import ast
import io
import tokenize
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parents[1]
PRODUCT = ROOT / "src/cylinder_friction"
HOUSES = (
    PRODUCT,
    ROOT / "tests",
    *(ROOT / house / part for house in ("live", "monitoring", "benchmark") for part in ("src", "tests")),
)
_NO_CODE = {
    tokenize.COMMENT,
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENDMARKER,
}
Sizes = Counter[str]
"""Numbers by ``lines``, ``code`` and ``modules``."""


def lines_of_code(source: str) -> int:
    """Count the lines that hold code other than docstrings and imports."""
    code: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type not in _NO_CODE:
            code.update(range(token.start[0], token.end[0] + 1))
    for node in ast.walk(ast.parse(source)):
        text = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
        if text or isinstance(node, ast.Import | ast.ImportFrom):
            assert isinstance(node, ast.stmt)
            code.difference_update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return len(code)


def size_of(path: Path) -> Sizes:
    """Count a module, or all modules below a folder."""
    sizes: Sizes = Counter()
    for module in path.rglob("*.py") if path.is_dir() else [path]:
        source = module.read_text(encoding="utf-8")
        sizes.update(lines=len(source.splitlines()), code=lines_of_code(source), modules=1)
    return sizes


def rows_of_packages() -> list[tuple[Sizes, str]]:
    """Return the size and name of each package and subpackage of the product, the largest first."""
    folders = [folder for level in ("*", "*/*") for folder in PRODUCT.glob(level) if any(folder.rglob("*.py"))]
    rows = [(size_of(folder), folder.relative_to(PRODUCT).as_posix()) for folder in folders if folder.is_dir()]
    return sorted(rows, key=lambda row: -row[0]["lines"])


def main() -> None:
    """Print one line per house, then one per package."""
    houses = [(size_of(folder), folder.relative_to(ROOT).as_posix()) for folder in HOUSES if folder.is_dir()]
    for title, rows in (("folder", houses), ("package of the product", rows_of_packages())):
        print(f"  lines   of code  modules  {title}")
        for size, name in rows:
            print(f"{size['lines']:>7,} {size['code']:>9,} {size['modules']:>8}  {name}")
        print()


if __name__ == "__main__":
    main()
