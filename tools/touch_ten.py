"""Print which stages one changed line makes stale: ``python tools/touch_ten.py [REPOSITORY] [MODULE ...]``.

In a copy of a repository whose pipeline has run, a comment is added to one module at a time, ``code.yaml`` is written
anew, and DVC is asked.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path

MODULES = (
    "benchmark/src/friction_benchmark/models/machado.py",
    "src/cylinder_friction/deployment/fmu/export.py",
    "src/cylinder_friction/commands/latency.py",
    "src/cylinder_friction/tracking/log_run.py",
    "src/cylinder_friction/reporting/inspection/page.py",
    "src/cylinder_friction/rig/simulate.py",
    "src/cylinder_friction/signals/rts.py",
    "src/cylinder_friction/recordings/splits.py",
    "src/cylinder_friction/estimators/hybrid.py",
    "src/cylinder_friction/evaluation/metrics.py",
)


def stale_stages(repository: Path) -> list[str]:
    """Return the stages that DVC would run because something that they depend on has changed."""
    environment = {**os.environ, "PYTHONPATH": str(repository / "src")}
    run = partial(subprocess.run, cwd=repository, env=environment, capture_output=True, text=True, check=True)
    run([sys.executable, "-c", "from cylinder_friction.commands.cli import main; main(['code'])"])
    done = run([sys.executable, "-m", "dvc", "status", "--json"])
    return sorted(set(json.loads(done.stdout or "{}")) - {"code"})


def _link(source: str, target: str) -> None:
    try:
        os.link(source, target)
    except OSError:
        shutil.copy2(source, target)


def main() -> int:
    root = Path(sys.argv[1] if len(sys.argv) > 1 else ".").resolve()
    with tempfile.TemporaryDirectory(dir=root.parent) as scratch:
        copy = Path(scratch) / "copy"
        ignored = shutil.ignore_patterns(".venv", "__pycache__", ".git", "tmp", ".*_cache", "mlartifacts")
        shutil.copytree(root, copy, copy_function=_link, ignore=ignored)
        subprocess.run(["git", "init", "--quiet"], cwd=copy, check=True)  # noqa: S607
        before = stale_stages(copy)
        if before:
            print(f"{root}: not up to date before any change, but stale: {before}; run `dvc repro` first")
            return 1
        for module in sys.argv[2:] or MODULES:
            path = copy / module
            text = path.read_text(encoding="utf-8")
            path.unlink()  # the original has the same content on disk, which must stay
            path.write_text(f"{text}# one line more\n", encoding="utf-8")
            print(f"{module:<52} {', '.join(stale_stages(copy)) or '-'}", flush=True)
            path.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
