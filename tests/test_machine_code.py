"""Machine code that is kept on disk: whatever is wrong with it, a function is compiled again and gives the same."""

import importlib
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

DOUBLED = """
from cylinder_friction.machine_code import compiled

@compiled
def doubled(given):
    return 2.0 * given
"""
RUN = """
import resource, signal, sys
if len(sys.argv) > 1:
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]), resource.RLIM_INFINITY))
from kept_code import doubled
print(doubled(2.0), sum(doubled.stats.cache_hits.values()))
"""


@pytest.fixture
def run(tmp_path: Path) -> Callable[..., tuple[str, str]]:
    """Return a function that runs the compiled function in a process of its own and returns its output and errors."""
    (tmp_path / "kept_code.py").write_text(DOUBLED)
    path = os.pathsep.join([str(tmp_path), *filter(None, sys.path)])
    environment = {**os.environ, "PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1"}
    environment.pop("NUMBA_CACHE_DIR", None)

    def run(*most: str) -> tuple[str, str]:
        command = [sys.executable, "-c", RUN, *most]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True, cwd=tmp_path)
        return done.stdout.strip(), done.stderr

    return run


@pytest.mark.parametrize("damaged", [("nbi",), ("nbc",), ("nbi", "nbc")])
@pytest.mark.parametrize("left", [b"", b"no machine code", None])
def test_damaged_machine_code_is_compiled_again_once(
    run: Callable[..., tuple[str, str]], tmp_path: Path, damaged: tuple[str, ...], left: bytes | None
) -> None:
    assert (run(), run()) == (("4.0 0", ""), ("4.0 1", ""))
    for suffix in damaged:
        (path,) = (tmp_path / "__pycache__").glob(f"*.{suffix}")
        path.write_bytes(path.read_bytes()[:200] if left is None else left)
    assert (run(), run()) == (("4.0 0", ""), ("4.0 1", ""))


def test_on_a_full_disk_it_is_compiled_at_every_start_and_leaves_nothing(
    run: Callable[..., tuple[str, str]], tmp_path: Path
) -> None:
    output, errors = run("100")  # bytes of a file
    assert output == "4.0 0"
    assert f"machine code cannot be kept (in {tmp_path / '__pycache__'}: [Errno 27]" in errors
    assert [path.name for path in tmp_path.rglob("*") if "tmp" in path.name] == []
    assert (run()[0], run()[0]) == ("4.0 0", "4.0 1")


def test_machine_code_that_names_what_another_version_had_is_compiled_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = "from typing import NamedTuple\nfrom cylinder_friction.machine_code import compiled\n"
    kept += "{0} = NamedTuple('{0}', [('x', float)])\n@compiled\ndef doubled(given):\n    return 2.0 * given.x\n"
    monkeypatch.syspath_prepend(tmp_path)
    for name in ("Earlier", "Later"):
        (tmp_path / "other_code.py").write_text(kept.format(name))
        monkeypatch.delitem(sys.modules, "other_code", raising=False)
        importlib.invalidate_caches()
        module = importlib.import_module("other_code")
        assert module.doubled(getattr(module, name)(2.0)) == 4.0
