"""One bad file never stops the others: what crashes or hangs a library in C ends only the process it is read in."""

import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd
import psutil
import pytest
import scipy.io

import format_writers
from cylinder_friction.recordings.formats import isolated
from cylinder_friction.recordings.formats.reading import read_logged_file
from cylinder_friction.recordings.recording import RecordingError

ROWS = np.arange(6.0)
DIMENSIONS = b"\x05\0\0\0\x08\0\0\0\x01"
"""How the dimensions of one row begin in a MATLAB file: int32, 8 bytes, 1."""
ON_LINUX = pytest.mark.skipif(sys.platform != "linux", reason="signals and processes as on Linux")


def write_good(path: Path) -> Path:
    with h5py.File(path, "w") as file:
        file["P1"] = ROWS
        file["P1"].attrs["unit"] = "bar"
        file["state"] = np.array(["up", "", "ü"] * 2, dtype=h5py.string_dtype())
    return path


def write_crashing(path: Path) -> Path:
    """Write an attribute of text whose type says it is neither text nor a sequence; libhdf5 follows a wild pointer."""
    content = bytearray(write_good(path).read_bytes())
    content[content.index(b"unit\0\0\0\0\x19") + 9] = 255
    path.write_bytes(content)
    return path


def write_greedy_matlab(path: Path) -> Path:
    """Write a struct that claims to be an array of a thousand million; SciPy fills the memory with them."""
    scipy.io.savemat(path, {"t": ROWS[:, None], "units": {"t": "s"}})
    content = bytearray(path.read_bytes())
    content[content.index(DIMENSIONS) + 15] = 64
    path.write_bytes(content)
    return path


def write_hanging(path: Path) -> Path:
    """Write a heap of texts whose objects do not fill it; libhdf5 looks for the next one for ever."""
    content = bytearray(write_good(path).read_bytes())
    content[content.index(b"GCOL") + 25] = 1
    path.write_bytes(content)
    return path


@ON_LINUX
@pytest.mark.parametrize(
    ("write", "limits", "refusal"),
    [
        (write_crashing, {}, "reading it crashed the HDF5 library; the file is damaged; copy it"),
        (write_hanging, {"LIMIT_S": 0.6}, "reading it took longer than 1 s; the file is damaged; copy it again, or e"),
        (write_greedy_matlab, {"LIMIT_BYTES": 1 << 29}, "damaged"),
    ],
)
@pytest.mark.extended
def test_a_file_that_crashes_hangs_or_fills_the_memory_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, write: Any, limits: dict[str, float], refusal: str
) -> None:
    good, bad = write_good(tmp_path / "good"), write(tmp_path / "bad")
    before = read_logged_file(good)[0]
    for _ in range(2):
        with monkeypatch.context() as patch:
            patch.setattr(isolated, "LIMIT_PER_BYTE_S", 0.4 / bad.stat().st_size)  # a large file has more time
            for name, limit in limits.items():
                patch.setattr(isolated, name, limit)
            with pytest.raises(RecordingError, match=refusal):
                read_logged_file(bad)
        pd.testing.assert_frame_equal(read_logged_file(good)[0].channels, before.channels)


def run(text: str, script: Path, *arguments: Path) -> subprocess.CompletedProcess[str]:
    head = "import os, sys, signal\nfrom pathlib import Path\n"
    head += "from cylinder_friction.recordings.formats.reading import read_logged_file\n"
    head += "from cylinder_friction.recordings.formats.isolated import _READERS\n"
    script.write_text(head + text, encoding="utf-8")
    command = [sys.executable, "-W", "error", str(script), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=60.0, check=False)


@ON_LINUX
def test_a_script_without_a_guard_runs_once(tmp_path: Path) -> None:
    text = "print(len(read_logged_file(Path(sys.argv[1]))[0].channels), flush=True)\n"
    done = run(text, tmp_path / "script.py", write_good(tmp_path / "log"))
    assert (done.stdout, done.returncode) == ("6\n", 0)


@pytest.mark.extended
@pytest.mark.parametrize("ending", ["", "os.kill(os.getpid(), signal.SIGKILL)"])
@ON_LINUX
def test_the_process_ends_with_its_parent_and_in_silence(tmp_path: Path, ending: str) -> None:
    format_writers.write_mdf4(tmp_path / "whole", *format_writers.synthetic(40))
    (tmp_path / "noise").write_bytes((tmp_path / "whole").read_bytes()[:900])
    text = (
        "for path in sys.argv[1:]:\n    try: read_logged_file(Path(path))\n    except ValueError: pass\n"
        f"print(_READERS[os.getpid()][1].pid, flush=True)\n{ending}\n"
    )
    done = run(text, tmp_path / "script.py", write_good(tmp_path / "log"), tmp_path / "noise")
    assert done.stderr == ""
    assert done.returncode == (-signal.SIGKILL if ending else 0)
    with suppress(psutil.NoSuchProcess):
        process = psutil.Process(int(done.stdout))
        if process.status() != psutil.STATUS_ZOMBIE:  # one that ended but was not collected does not run
            process.wait(timeout=60.0)
