"""The command ``serve``: serve a registered model with MLflow's server and print a curl to try."""

import argparse
import json
import shlex
import signal
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import yaml

from cylinder_friction.deployment.child_server import child_server, listenable, noted_signals, wait_for_signal
from cylinder_friction.params.checking import load_params
from cylinder_friction.tracking.lineage import download_model, version_of
from cylinder_friction.tracking.store import open_store

EXAMPLE_FILE = "serving_input_example.json"  # MLflow's example of a request
LAST_ROW = "grep -o '{[^{}]*}' | tail -n 1"  # Of the answer, whole


def run(options: argparse.Namespace) -> int:
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # it ends a download as Ctrl-C does
    port = listenable(options.port)
    with TemporaryDirectory(prefix="cylinder-friction-serve-") as scratch:
        name, folder = _locate_model(options.model, Path(scratch))
        command = [sys.executable, "-m", "mlflow", "models", "serve", "--env-manager", "local", "-m", str(folder)]
        command += ["--host", options.host, "--port", str(port), "--workers", str(options.workers)]
        url = f"http://{_reachable_host(options.host)}:{port}"
        received = noted_signals()
        with child_server(command, f"{url}/ping", received, cwd=Path(scratch)) as server:
            print(_announcement(name, url, folder), flush=True)
            wait_for_signal(received, server)
    return 0


def _locate_model(model: str | None, scratch: Path) -> tuple[str, Path]:
    """Find a model's name and folder; the files of a registered one are copied below ``scratch``."""
    if model is None:
        model = load_params().champion
    if model.startswith("models:/"):
        with open_store(Path.cwd(), create=False) as store:
            version = version_of(store, model)
            return f"{version.name} version {version.version}", download_model(store, version, scratch / "model")
    if not (Path(model) / "MLmodel").is_file():
        raise FileNotFoundError(
            f"{model}: expected models:/NAME@ALIAS, models:/NAME/VERSION, or a folder with an MLmodel in it"
        )
    return str(Path(model)), Path(model).resolve()


def _reachable_host(host: str) -> str:
    """Name the host by which this machine reaches a server that listens on ``host``."""
    host = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(host, host)  # noqa: S104
    return f"[{host}]" if ":" in host else host


def _announcement(name: str, url: str, folder: Path) -> str:
    example, described = folder / EXAMPLE_FILE, yaml.safe_load((folder / "MLmodel").read_text("utf-8"))
    bounds = (described.get("metadata") or {}).get("bounds", "not stated")
    rows = len(json.loads(example.read_text("utf-8"))["dataframe_split"]["data"])
    curl = f"curl -s {url}/invocations -H 'Content-Type: application/json' \\\n  -d {shlex.quote(f'@{example}')}"
    return (
        f"serving {name} at {url} (stop with Ctrl-C)\n\ntry it in another terminal:\n\n{curl} | {LAST_ROW}\n\n"
        f"It sends {rows} rows of a recording and shows the last one; rows of the first 3 s are flagged WARMING.\n"
        "friction_n is in newtons, positive when it opposes extension. Send the rows of a recording in order, at the\n"
        f"trained sample time. Bounds: {bounds}.\nA new champion is served after a restart."
    )
