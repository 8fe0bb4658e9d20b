"""The C client gets the newtons of the step, to the last bit, over a kill of the service."""

import shutil
import subprocess
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from cylinder_friction.arrays import Array
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.execution.ports import free_port
from live_service import running

SOURCE = Path(__file__).parents[1] / "examples" / "live_client.c"
COMPILER = shutil.which("gcc") or shutil.which("cc")
pytestmark = [pytest.mark.extended, pytest.mark.skipif(COMPILER is None, reason="no C compiler is installed")]


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    built = tmp_path_factory.mktemp("c") / "live_client"
    strict = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-pedantic"]
    subprocess.run([str(COMPILER), *strict, "-o", str(built), str(SOURCE)], check=True)
    return built


def lines_of(samples: Array) -> str:
    return "".join(f"{','.join(map(repr, row))}\n" for row in samples.tolist())


def test_it_gets_the_newtons_of_the_step_over_a_kill(
    program: Path, small_hybrid: HybridEstimator, samples: Array, model: Path, tmp_path: Path
) -> None:
    samples = samples[:1500].copy()
    samples[700, 1] = np.nan
    newtons, flags = small_hybrid.real_time().run(samples)
    port = free_port()
    command = [str(program), "127.0.0.1", str(port), "press 7", "0.005"]
    output: list[str] = []
    client = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    with running(model, tmp_path, port) as first, client:
        assert client.stdin is not None
        assert client.stdout is not None
        reader = threading.Thread(target=lambda: output.append(client.stdout.read()))  # type: ignore[union-attr]
        reader.start()
        try:
            client.stdin.write(lines_of(samples[:900]))
            client.stdin.flush()
            time.sleep(1.5)  # some of it is kept
            client.stdin.write(lines_of(samples[900:1100]))
            client.stdin.flush()
            first.kill()
            first.wait()
            with running(model, tmp_path, port):
                client.stdin.write(lines_of(samples[1100:]))
                client.stdin.close()
                assert client.wait(120.0) == 0
        finally:
            client.kill()
            reader.join()
    got = np.array([[float(value) for value in line.split(",")] for line in output[0].splitlines()])
    np.testing.assert_array_equal(got[:, 0], np.arange(1500))
    np.testing.assert_array_equal(got[:, 1:4], newtons)
    np.testing.assert_array_equal(got[:, 4], flags)


def test_what_it_is_refused_and_what_is_no_row_is_printed(program: Path, model: Path, tmp_path: Path) -> None:
    port = free_port()
    with running(model, tmp_path, port):
        for sample_time_s, row, words in (("0.001", "", "trained at 0.005 s"), ("0.005", "a,b", "row 0: expected")):
            command = [str(program), "127.0.0.1", str(port), "press", sample_time_s]
            done = subprocess.run(command, input=row, capture_output=True, text=True, timeout=60.0, check=False)
            assert done.returncode == 1
            assert words in done.stderr
