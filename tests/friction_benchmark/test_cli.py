"""The command line of the benchmark."""

import os
import subprocess
import sys

from cylinder_friction.commands.cli import UNREAD


def test_a_reader_that_has_ended_ends_the_command_without_a_traceback() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    command = (sys.executable, "-m", "friction_benchmark.cli", "--help")
    given = {**os.environ, "PYTHONUNBUFFERED": ""}
    done = subprocess.run(command, stdout=writing, stderr=subprocess.PIPE, text=True, env=given)
    os.close(writing)
    assert (done.returncode, done.stderr) == (UNREAD, "")
