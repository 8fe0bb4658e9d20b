import subprocess
import sys

import pytest

from cylinder_friction.execution.progress import Lines, _unfinished, progress

LONG_WORK = """
import time
from cylinder_friction.execution.progress import progress
with progress(words="search", total=3, unit="trial") as bar:
    bar.update()
    for _ in progress([1, 2], "train", unit="epoch"):
        time.sleep({seconds})
"""


def _stderr_of(seconds: float) -> str:
    code = LONG_WORK.format(seconds=seconds)
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stderr


def test_without_a_terminal_one_line_states_what_is_done_and_how_far_it_is() -> None:
    lines = _stderr_of(2.5).splitlines()
    assert len(lines) == 1
    outer, inner = lines[0].split("; ")
    assert outer.startswith("search: 1 of 3 trials after 0:00:0")
    assert outer.endswith(" left")
    assert inner.startswith(("train: 0 of 2 epochs after 0:00:0", "train: 1 of 2 epochs after 0:00:0"))


def test_short_work_prints_nothing() -> None:
    assert _stderr_of(0.0) == ""


def test_work_that_fails_is_no_longer_named() -> None:
    with pytest.raises(KeyError), progress(words="train", total=2, unit="epoch") as bar:
        raise KeyError
    assert isinstance(bar, Lines)
    assert bar not in _unfinished
    assert list(progress(iter("ab"), "read", 2, unit="letter")) == ["a", "b"]
