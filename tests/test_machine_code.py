"""Where compiled code is kept when neither the package nor the user's cache can be written."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from cylinder_friction import machine_code


def test_a_package_that_cannot_be_written_works_with_a_folder_of_its_own(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(machine_code, "__file__", "/sys/cylinder_friction/machine_code.py")
    monkeypatch.setenv(machine_code.FOLDER, "")
    monkeypatch.setenv("XDG_CACHE_HOME", "/sys/cache" if Path("/sys/kernel").is_dir() else str(tmp_path / "none"))
    if os.access("/sys", os.W_OK):
        monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.warns(UserWarning, match="code is compiled anew at every start, .* set NUMBA_CACHE_DIR to a folder"):
        machine_code.give_place()
    folder = Path(os.environ[machine_code.FOLDER])
    assert folder.stat().st_mode & 0o777 == 0o700
    machine_code.give_place()
    assert os.environ[machine_code.FOLDER] == str(folder), "processes that are started use it as well"


def test_a_package_that_can_be_written_is_left_alone() -> None:
    code = "import os, cylinder_friction; print(os.environ.get('NUMBA_CACHE_DIR'))"
    given = {key: value for key, value in os.environ.items() if key != machine_code.FOLDER}
    done = subprocess.run([sys.executable, "-c", code], env=given, capture_output=True, text=True, check=True)
    assert done.stdout == "None\n"
