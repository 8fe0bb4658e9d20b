"""Finding the model to serve: in a folder, or in a registry, whose alias may move to another version later."""

import json
import shutil
from pathlib import Path
from typing import Any

from cylinder_friction.recordings.files import hash_of, read_json, write_json
from cylinder_friction.service.scoring.settings import ServingError
from cylinder_friction.tracking.aliases import alias_version

CURRENT_FILE = "current.json"
LOCATED_FILE = "located.json"


def locate(model: str, root: Path, folder: Path) -> None:
    """Copy a model into a server's folder, and name it there as the one in service.

    Args:
        model: ``models:/<name>@<alias>``, ``models:/<name>/<version>``, or the folder of an MLflow model.
        root: The repository's root.
        folder: The server's; a version that was copied before is not copied again.

    Raises:
        TrackingError: The registry cannot be reached or has no such model.
        FileNotFoundError: The folder holds no MLflow model.
        ServingError: It cannot be served; the one that was in service before stays.
    """
    from cylinder_friction.service.scoring.model_source import ServedModel, open_model, write_current

    registered = model.startswith("models:/")
    located = _copy_registered(model, root, folder) if registered else _copy_folder(Path(model), folder)
    copy = folder / located["version"]
    served = ServedModel(copy, located["name"], located["version"])
    try:
        located["bounds"] = open_model(served).graph.bounds
    except ServingError:
        shutil.rmtree(copy)  # copied anew when it is asked for again
        raise
    example = json.loads((copy / "input_example.json").read_text("utf-8"))
    located["example"] = {"columns": example["columns"], "data": example["data"]}
    write_json(folder / LOCATED_FILE, located)
    write_current(folder / CURRENT_FILE, served)


def alias_moved(folder: Path) -> bool:
    """Return whether the alias that was located names another version now; false where that cannot be known."""
    located: dict[str, Any] = read_json(folder / LOCATED_FILE)
    if not located["alias"]:
        return False
    return alias_version(located["store"], located["name"], located["alias"]) not in (None, located["version"])


def _copy_registered(model: str, root: Path, folder: Path) -> dict[str, Any]:
    from cylinder_friction.tracking.model_folder import download_model, version_of
    from cylinder_friction.tracking.store import open_store

    with open_store(root, create=False) as store:
        version = version_of(store, model)
        if not (target := folder / str(version.version)).is_dir():
            download_model(store, version, folder / "draft").replace(target)
        alias = model.partition("@")[2]
        return {"name": version.name, "version": str(version.version), "alias": alias, "store": store.uri}


def _copy_folder(model: Path, folder: Path) -> dict[str, Any]:
    if not (model / "MLmodel").is_file():
        raise FileNotFoundError(
            f"{model}: expected models:/<name>@<alias>, models:/<name>/<version>, or a folder with an MLmodel in it"
        )
    version = hash_of(model)[:12]
    if not (target := folder / version).is_dir():
        Path(shutil.copytree(model, folder / "draft", dirs_exist_ok=True)).replace(target)
    return {"name": model.resolve().name, "version": version, "alias": "", "store": ""}
