"""The command ``summary``: print the comparison in the width of a terminal, and where things lie."""

import argparse
import re
from collections.abc import Iterator
from pathlib import Path

REPORTS = Path("reports")
_CELLS = re.compile(r"(?<!\\)\|")


def run(_options: argparse.Namespace) -> None:
    if not (REPORTS / "table.md").is_file():
        table = (REPORTS / "table.md").absolute()
        raise FileNotFoundError(f"{table}: not there; run `dvc repro` first in a project's folder")
    print("\n".join(narrow((REPORTS / "table.md").read_text(encoding="utf-8"))).strip())
    print(
        f"""
newtons  {REPORTS / "table.md"}
report   {REPORTS / "report.html"}
figures  {REPORTS / "figures"}

next     cylinder-friction ui                  look at runs and models
         cylinder-friction serve               ask the champion, by curl
         cylinder-friction live --replay LOGS  watch friction in real time"""
    )


def narrow(markdown: str) -> Iterator[str]:
    """Yield the lines of a Markdown text whose tables hold percentages alone, a star in place of bold."""
    rows: list[list[str]] = []
    for line in [*markdown.splitlines(), ""]:
        if line.startswith("|"):
            if not line.startswith("|---"):
                rows.append([_short(cell.strip()) for cell in _CELLS.split(line)[1:-1]])
            continue
        if rows:
            widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
            for first, *others in rows:
                numbers = (cell.rjust(width) for cell, width in zip(others, widths[1:], strict=True))
                yield "  ".join([first.ljust(widths[0]), *numbers]).rstrip()
            rows = []
        yield re.sub(":$", " [%], by condition:", line.replace("Bold:", "*:"))


def _short(cell: str) -> str:
    bold, cell = cell.startswith("**"), cell.strip("*")
    percent = re.match(r"([\d.]+) % \(", cell)
    head = re.match(r"Condition (.+) \[%", cell)
    if percent:
        return f"{percent[1]}{'*' if bold else ' '}"
    return f"{head[1]} " if head else cell
