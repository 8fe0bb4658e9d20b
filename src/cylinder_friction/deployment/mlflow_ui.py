"""The MLflow UI: MLflow's own server, on a free port, on this repository."""

import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from cylinder_friction.deployment.child_server import child_server, listenable, noted_signals, wait_for_signal
from cylinder_friction.tracking.log_run import PIPELINE, STAGE_TAG, VIEW
from cylinder_friction.tracking.store import EXPERIMENT, LOCAL_FOLDER, artifact_folder, open_store, tracking_uri

_HOST = "127.0.0.1"
_WITHOUT_JOBS = "MLFLOW_SERVER_ENABLE_JOB_EXECUTION"
"""If false, the UI starts without half a dozen processes for evaluation jobs of language models."""


def run_ui(root: Path, port: int | None = None) -> int:
    """Open the MLflow UI on the repository's runs until Ctrl-C or SIGTERM, on this port or a free one.

    Raises:
        TrackingError: The UI cannot be opened, or its server ended by itself.
        KeyboardInterrupt: A signal came while the server was starting.

    """
    received = noted_signals()
    with served_ui(root, port, received) as (url, server):
        sys.stdout.write(
            f"MLflow UI (stop with Ctrl-C)\n  runs of the pipeline   {runs_page(url, root)}\n"
            f"  registered models      {url}/#/models?workflowType=machine_learning\n"
        )
        sys.stdout.flush()
        wait_for_signal(received, server)
    sys.stdout.write("\n")
    return 0


@contextmanager
def served_ui(
    root: Path, port: int | None = None, received: Sequence[int] = ()
) -> Iterator[tuple[str, subprocess.Popen[bytes] | None]]:
    """Yield the URL of the MLflow UI, once it is ready, and its process; ``port`` None takes a free one.

    A tracking server brings its own UI; the process is None then.

    Raises:
        TrackingError: Something else listens there, or the server does not start.
        KeyboardInterrupt: A signal was ``received`` before it was ready.
    """
    with open_store(root, create=False) as store:  # the UI would make an empty one
        log_folder = store.root / LOCAL_FOLDER
    log_folder.mkdir(exist_ok=True)
    uri = tracking_uri(root)
    if uri.startswith(("http://", "https://")):
        yield uri, None
        return
    port = listenable(port or 0)
    command = [sys.executable, "-m", "mlflow", "server", "--backend-store-uri", uri, "--host", _HOST]
    command += ["--default-artifact-root", artifact_folder(root).as_uri(), "--port", str(port), "--workers", "1"]
    given = {
        "MLFLOW_TRACKING_URI": uri,
        "MLFLOW_REGISTRY_URI": uri,
        _WITHOUT_JOBS: os.environ.get(_WITHOUT_JOBS, "false"),
    }
    url, log = f"http://{_HOST}:{port}", log_folder / f"server-{port}.log"
    with child_server(command, f"{url}/health", received, log=log, environment=given) as server:
        yield url, server
    log.unlink(missing_ok=True)  # kept only if something went wrong


def runs_page(url: str, root: Path) -> str:
    """Return the address of the newest pipeline's table of runs in the UI at ``url``, with the errors as columns."""
    with open_store(root, create=False) as store:
        own = store.client.search_experiments(filter_string=f"name LIKE '{EXPERIMENT}%'")
        newest = store.client.search_runs(
            [each.experiment_id for each in own],
            f"tags.{STAGE_TAG} = '{PIPELINE}'",
            max_results=1,
            order_by=["attributes.end_time DESC"],
        )
        experiment = newest[0].info.experiment_id if newest else own[0].experiment_id if own else "0"
    return f"{url}/#/experiments/{experiment}/runs?workflowType=machine_learning&viewStateShareKey={VIEW}"
