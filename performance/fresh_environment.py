"""Load the registered model where nothing of this project is installed, and print what its first answer costs.

    python performance/fresh_environment.py MODEL_FOLDER [--env-managers hand virtualenv uv]

Each environment is made of the model's own ``requirements.txt``, which takes minutes. The second load finds the code
that the first one compiled. With ``virtualenv`` and ``uv``, MLflow makes the environment and asks the model (`mlflow
models predict`); its time includes MLflow's own start.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
import venv
from pathlib import Path

ASK = """
import sys, time
begin_s = time.perf_counter()
import mlflow
model = mlflow.pyfunc.load_model(sys.argv[1])
model.predict(model.input_example)
took_s = time.perf_counter() - begin_s
import resource, json
training = sorted({"torch", "sklearn"} & {*sys.modules})
print(json.dumps([took_s, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024, training]))
"""


def by_hand(model: Path, folder: Path, environment: dict[str, str]) -> None:
    """Make an environment with ``venv`` and ``pip``; print two loads in it."""
    python = folder / "environment/bin/python"
    venv.create(folder / "environment", with_pip=True)
    subprocess.run([python, "-m", "pip", "install", "-q", "-r", model / "requirements.txt"], check=True)
    for load in ("first", "second"):
        command = [str(python), "-c", ASK, str(model)]
        done = subprocess.run(command, cwd=folder, env=environment, check=True, stdout=subprocess.PIPE)
        took_s, peak_mb, training = json.loads(done.stdout.splitlines()[-1])
        print(
            f"hand        {load:<7} import to answer {took_s:5.1f} s, peak memory {peak_mb:.0f} MB, "
            f"training libraries imported: {', '.join(training) or 'none'}",
            flush=True,
        )


def by_mlflow(manager: str, model: Path, folder: Path, environment: dict[str, str]) -> None:
    """Let MLflow make an environment and ask the model twice."""
    rows = folder / "rows.json"
    rows.write_text((model / "serving_input_example.json").read_text("utf-8"), "utf-8")
    command = [sys.executable, "-m", "mlflow", "models", "predict", "-m", str(model), "-i", str(rows)]
    command += ["-t", "json", "-o", str(folder / "answer.json"), "--env-manager", manager]
    for load in ("installs, first", "second"):
        begin_s = time.perf_counter()
        subprocess.run(command, cwd=folder, env=environment, check=True, capture_output=True)
        rows_back = len(json.loads((folder / "answer.json").read_text("utf-8"))["predictions"])
        print(f"{manager:<11} {load:<15} {time.perf_counter() - begin_s:5.1f} s, {rows_back} rows", flush=True)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", type=Path, help="folder of a logged model, with its MLmodel")
    parser.add_argument("--env-managers", nargs="+", default=["hand"], choices=["hand", "virtualenv", "uv"])
    options = parser.parse_args()
    for manager in options.env_managers:
        with tempfile.TemporaryDirectory() as scratch:
            folder = Path(scratch)
            environment = {
                **os.environ,
                "XDG_CACHE_HOME": str(folder / "cache"),
                "MLFLOW_ENV_ROOT": str(folder / "envs"),
            }
            for name in ("PYTHONPATH", "NUMBA_CACHE_DIR"):
                environment.pop(name, None)
            if manager == "hand":
                by_hand(options.model.resolve(), folder, environment)
            else:
                by_mlflow(manager, options.model.resolve(), folder, environment)
    return 0


if __name__ == "__main__":
    sys.exit(main())
