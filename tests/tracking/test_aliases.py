"""Which version an alias names, read from SQLite and from a server, as MLflow's own client has it."""

import base64
import json
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

import pytest
from mlflow import MlflowClient

from cylinder_friction.tracking.aliases import alias_version

NAME = "friction of a/b"


def test_of_a_database(root: Path) -> None:
    uri = f"sqlite:///{root / 'mlflow.db'}"
    client = MlflowClient(uri, uri)
    assert alias_version(uri, NAME, "champion") is None
    client.create_registered_model(NAME.replace("/", "-"))
    client.create_model_version(NAME.replace("/", "-"), str(root))
    client.set_registered_model_alias(NAME.replace("/", "-"), "champion", "1")
    assert alias_version(uri, NAME.replace("/", "-"), "champion") == "1"


@pytest.mark.parametrize("uri", ["sqlite:///none.db", "postgresql://nobody@127.0.0.1/none", "http://127.0.0.1:9", ""])
def test_of_no_store_it_is_not_known(uri: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert alias_version(uri, NAME, "champion") is None
    assert list(tmp_path.iterdir()) == []


class Registry(BaseHTTPRequestHandler):
    """What an MLflow server sends, to who has the password."""

    def do_GET(self) -> None:
        expected = "Basic " + base64.b64encode(b"user:secret").decode()
        path = "/api/2.0/mlflow/registered-models/alias?name=friction+of+a%2Fb&alias=champion"
        right = self.headers["Authorization"] == expected and self.path == path
        body = json.dumps({"model_version": {"name": NAME, "version": "3"}} if right else {}).encode()
        self.send_response(200 if right else 401)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture
def server() -> Iterator[str]:
    with HTTPServer(("127.0.0.1", 0), Registry) as running:
        thread = threading.Thread(target=running.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{running.server_port}"
        running.shutdown()
        thread.join()


def test_of_a_server(server: str, monkeypatch: pytest.MonkeyPatch) -> None:
    assert alias_version(server, NAME, "champion") is None
    monkeypatch.setenv("MLFLOW_TRACKING_USERNAME", "user")
    monkeypatch.setenv("MLFLOW_TRACKING_PASSWORD", "secret")
    assert alias_version(server, NAME, "champion") == "3"
