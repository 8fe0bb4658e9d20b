"""Which version an alias names, without MLflow: asked every few seconds by a process that shall stay small."""

import base64
import json
import os
import sqlite3
from contextlib import closing
from pathlib import Path
from urllib.parse import quote, urlencode

_TIMEOUT_S = 2.0


def alias_version(uri: str, name: str, alias: str) -> str | None:
    """Return the version of a registered model that an alias names.

    None where the alias or the store is not there, or the store is neither an MLflow server nor SQLite.
    """
    try:
        if uri.startswith("sqlite:///"):
            return _in_file(Path(uri.removeprefix("sqlite:///")), name, alias)
        if uri.startswith(("http://", "https://")):
            return _at_server(uri, name, alias)
    except (OSError, ValueError, KeyError, sqlite3.Error):
        pass
    return None


def _in_file(path: Path, name: str, alias: str) -> str | None:
    query = "SELECT version FROM registered_model_aliases WHERE name = ? AND alias = ?"
    with closing(sqlite3.connect(f"file:{quote(str(path))}?mode=ro", uri=True, timeout=_TIMEOUT_S)) as database:
        found = database.execute(query, (name, alias)).fetchone()
    return None if found is None else str(found[0])


def _at_server(uri: str, name: str, alias: str) -> str:
    from urllib.request import Request, urlopen  # slow to import, and only wanted here

    address = f"{uri.rstrip('/')}/api/2.0/mlflow/registered-models/alias?{urlencode({'name': name, 'alias': alias})}"
    with urlopen(Request(address, headers=_credentials()), timeout=_TIMEOUT_S) as response:  # noqa: S310
        return str(json.load(response)["model_version"]["version"])


def _credentials() -> dict[str, str]:
    """Return the header that MLflow's own client makes of the same variables."""
    if token := os.environ.get("MLFLOW_TRACKING_TOKEN"):
        return {"Authorization": f"Bearer {token}"}
    if user := os.environ.get("MLFLOW_TRACKING_USERNAME"):
        both = f"{user}:{os.environ.get('MLFLOW_TRACKING_PASSWORD', '')}"
        return {"Authorization": f"Basic {base64.b64encode(both.encode()).decode()}"}
    return {}
