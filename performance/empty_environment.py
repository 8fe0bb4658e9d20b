"""The logged model in an environment that has never seen this project: megabytes and seconds.

    python performance/empty_environment.py [--run FOLDER]

Copies the champion out of a finished run, makes a virtual environment from its ``requirements.txt`` alone, and there
estimates the model's own example rows, with ``mlflow.pyfunc`` and behind ``mlflow models serve``. Prints how large the
environment is, how long each step took, and how far its estimates are from this environment's.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
import urllib.request
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.network.ports import free_port
from cylinder_friction.tracking.model_folder import download_model, version_of
from cylinder_friction.tracking.store import open_store

if TYPE_CHECKING:
    from collections.abc import Iterator

CHAMPION = "models:/friction-estimator@champion"
PREDICT = """
import json, resource, sys, time
began = time.perf_counter()
import mlflow
model = mlflow.pyfunc.load_model(sys.argv[1])
loaded = time.perf_counter()
rows = model.input_example
found = model.predict(rows)
assert "cylinder_friction" not in sys.modules
print(json.dumps({
    "friction_n": found["friction_n"].tolist(), "load_s": loaded - began, "predict_s": time.perf_counter() - loaded,
    "peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
}))
"""


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--run", type=Path, default=Path(), help="root of a finished run")
    run = parser.parse_args().run.resolve()
    with tempfile.TemporaryDirectory() as scratch:
        place = Path(scratch)
        with open_store(run) as store:
            model = download_model(store, version_of(store, CHAMPION), place / "model")
        example = json.loads((model / "input_example.json").read_text("utf-8"))
        sys.stdout.write(f"requirements: {', '.join((model / 'requirements.txt').read_text('utf-8').split())}\n")
        sys.stdout.write(f"model folder: {megabytes(model):.2f} MB\n")
        python, seconds = environment(model / "requirements.txt", place / "venv")
        sys.stdout.write(f"environment: {megabytes(place / 'venv'):.0f} MB, made in {seconds:.0f} s\n")
        clean = {"PATH": f"{python.parent}{os.pathsep}{os.environ['PATH']}", "HOME": str(place)}
        done = subprocess.run(
            [python, "-c", PREDICT, model], env=clean, cwd=place, capture_output=True, text=True, check=True
        )
        found = json.loads(done.stdout.splitlines()[-1])
        stream = load_estimator(run / "models/hybrid").real_time()
        here = [stream.step(*row).friction_n for row in example["data"]]
        sys.stdout.write(
            f"mlflow.pyfunc: loaded in {found['load_s']:.1f} s, {len(here)} rows in {found['predict_s']:.3f} s, peak "
            f"{found['peak_mb']:.0f} MB, {difference(found['friction_n'], here):.2g} N from this environment\n"
        )
        with served(python, model, clean, place) as (url, waited_s):
            body = json.dumps({"dataframe_split": {"columns": example["columns"], "data": example["data"]}}).encode()
            request = urllib.request.Request(f"{url}/invocations", body, {"Content-Type": "application/json"})  # noqa: S310
            with urllib.request.urlopen(request) as response:  # noqa: S310
                rows = json.loads(response.read())["predictions"]
        sys.stdout.write(
            f"mlflow models serve: ready after {waited_s:.1f} s, "
            f"{difference([row['friction_n'] for row in rows], here):.2g} N from this environment\n"
        )


def environment(requirements: Path, folder: Path) -> tuple[Path, float]:
    """Return the interpreter of a new environment with these requirements, and how long it took."""
    began = time.monotonic()
    subprocess.run([sys.executable, "-m", "venv", folder], check=True)
    python = folder / "bin/python"
    subprocess.run([python, "-m", "pip", "install", "-q", "-r", requirements], check=True)
    return python, time.monotonic() - began


def megabytes(folder: Path) -> float:
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file() and not path.is_symlink()) / 1e6


def difference(found: list[float], here: list[float]) -> float:
    return max(abs(one - other) for one, other in zip(found, here, strict=True))


@contextmanager
def served(python: Path, model: Path, env: dict[str, Any], folder: Path) -> Iterator[tuple[str, float]]:
    """Yield the URL of ``mlflow models serve`` and how long it took to be ready."""
    url, began = f"http://127.0.0.1:{(port := free_port())}", time.monotonic()
    command = ["models", "serve", "-m", str(model), "--env-manager", "local", "-h", "127.0.0.1", "-p", str(port)]
    with (folder / "server.log").open("w") as log:
        server = subprocess.Popen([python, "-m", "mlflow", *command], env=env, cwd=folder, stdout=log, stderr=log)
        try:
            while True:
                try:
                    urllib.request.urlopen(f"{url}/ping").close()  # noqa: S310
                    break
                except OSError as error:
                    if server.poll() is not None or time.monotonic() - began > 120.0:
                        raise SystemExit((folder / "server.log").read_text("utf-8")) from error
                    time.sleep(0.2)
            yield url, time.monotonic() - began
        finally:
            server.terminate()
            server.wait()


if __name__ == "__main__":
    main()
