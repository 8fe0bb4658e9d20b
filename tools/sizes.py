"""Print lines, lines of code and modules of Python per package: ``python tools/sizes.py [FOLDER]``, by default ``src``.

Lines of code are lines without docstrings, comments, blank lines and imports.
"""

from __future__ import annotations

import ast
import io
import sys
import tokenize
from collections import Counter
from pathlib import Path

_NO_CODE = {
    tokenize.COMMENT,
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENDMARKER,
}


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


def main(root: Path) -> None:
    """Print one line per package and subpackage, largest first."""
    lines: Counter[str] = Counter()
    code: Counter[str] = Counter()
    modules: Counter[str] = Counter()
    for path in root.rglob("*.py"):
        parts = path.relative_to(root).parts
        source = path.read_text(encoding="utf-8")
        for package in {parts[0], "/".join(parts[:2]) if len(parts) > 2 else parts[0]}:
            lines[package] += len(source.splitlines())
            code[package] += lines_of_code(source)
            modules[package] += 1
    print("  lines   of code  modules  package")
    for package, count in lines.most_common():
        print(f"{count:>7,} {code[package]:>9,} {modules[package]:>8}  {package}")


if __name__ == "__main__":
    main(Path(*sys.argv[1:2] or ["src"]))
