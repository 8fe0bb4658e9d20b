"""Compare the code that each stage of ``dvc.yaml`` depends on with the import graph; ``--write`` updates it."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import yaml

from cylinder_friction.import_graph import SOURCE, does_something, used_files
from cylinder_friction.run_record import STAGES

PROJECT = Path(__file__).parents[1]
PIPELINE = PROJECT / "dvc.yaml"


def code_of(stage: str) -> list[str]:
    """Return the files that a stage's module uses, relative to the project; a folder where it uses all of one."""
    files = {path.relative_to(SOURCE) for path in used_files(f"cylinder_friction.stages.{stage}")}
    return sorted(f"src/{path.as_posix()}" for path in _folded(files))


def _folded(files: set[Path]) -> set[Path]:
    whole = {
        folder
        for folder in {parent for file in files for parent in file.parents[:-2]}
        if all(path.relative_to(SOURCE) in files for path in _content(SOURCE / folder))
    }
    result = set()
    for file in files:
        result.add(next((folder for folder in reversed(file.parents) if folder in whole), file))
    return result


def _content(folder: Path) -> list[Path]:
    """Return all that a folder holds but caches, and but an ``__init__`` that does nothing."""
    files = (path for path in folder.rglob("*") if path.is_file() and "__pycache__" not in path.parts)
    return [path for path in files if not (path.name == "__init__.py" and not does_something(path))]


def differences(text: str) -> list[str]:
    """Return what is wrong with the code that the stages in a ``dvc.yaml`` depend on, one line per stage."""
    found = []
    stages = yaml.safe_load(text)["stages"]
    for name in STAGES:
        declared = {entry for entry in stages[name]["deps"] if entry.startswith("src/")}
        expected = set(code_of(name))
        if declared != expected:
            found.append(f"{name}: missing {sorted(expected - declared)}, not used {sorted(declared - expected)}")
    return found


def rewritten(text: str) -> str:
    """Return a ``dvc.yaml`` whose stages depend on the code that they use; all else in it stays as it is."""
    result: list[str] = []
    stage = ""
    for line in text.splitlines():
        if re.fullmatch(r"  \w+:", line):
            stage = line.strip(" :")
        if stage in STAGES and line.startswith("      - src/"):
            continue
        result.append(line)
        if stage in STAGES and line == "    deps:":
            result += [f"      - {path}" for path in code_of(stage)]
    return "\n".join(result) + "\n"


def main() -> int:
    text = PIPELINE.read_text(encoding="utf-8")
    if "--write" in sys.argv:
        PIPELINE.write_text(rewritten(text), encoding="utf-8")
        return 0
    wrong = differences(text)
    print("\n".join([*wrong, "run `make stages`"] if wrong else ["dvc.yaml: every stage depends on the code it uses"]))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
