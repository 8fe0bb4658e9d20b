"""Copies of repositories with a store of their own, since MLflow stores the absolute addresses of artifacts."""

import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

_LOCATIONS = {
    "experiments": "artifact_location",
    "runs": "artifact_uri",
    "logged_models": "artifact_location",
    "model_versions": "storage_location",
}


def copied(source: Path, target: Path) -> Path:
    """Copy a repository, data, cache and store included; the copy's store has the copy's artifacts."""
    shutil.copytree(source, target, symlinks=True)
    if (target / "mlflow.db").is_file():
        addresses = [(each / "mlartifacts").as_uri() for each in (source, target)]
        with closing(sqlite3.connect(target / "mlflow.db")) as database, database:
            for table, column in _LOCATIONS.items():
                database.execute(f"UPDATE {table} SET {column} = replace({column}, ?, ?)", addresses)
    return target
