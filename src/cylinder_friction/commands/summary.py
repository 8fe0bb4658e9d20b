"""The command ``summary``: print the comparison table and where things lie."""

import argparse
from pathlib import Path

REPORTS = Path("reports")


def run(_options: argparse.Namespace) -> None:
    if not (REPORTS / "table.md").is_file():
        table = (REPORTS / "table.md").absolute()
        raise FileNotFoundError(f"{table}: not there; run `dvc repro` first in a project's folder")
    print((REPORTS / "table.md").read_text(encoding="utf-8").rstrip())
    print(
        f"""
report   {REPORTS / "report.html"}
figures  {REPORTS / "figures"}

next     cylinder-friction ui      browse the runs, the search and the registered model
         cylinder-friction serve   serve the champion and try it with curl"""
    )
