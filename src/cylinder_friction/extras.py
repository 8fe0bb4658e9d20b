"""Libraries that only some work needs: which extra of the package brings each, and the message where it is missing."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

BROUGHT_BY = {
    "torch": "train",
    "sklearn": "train",
    "onnxruntime": "serve",
    "mlflow": "serve",
    "starlette": "serve",
    "uvicorn": "serve",
    "orjson": "serve",
    "prometheus_client": "serve",
    "websockets": "live",
    "optuna": "pipeline",
    "hydra": "pipeline",
    "omegaconf": "pipeline",
    "dvc": "pipeline",
    "dvc_data": "pipeline",
    "dvc_objects": "pipeline",
    "distributed": "cluster",
    "threadpoolctl": "cluster",
}
"""Module to extra, for everything but the readers of formats, which name theirs themselves."""


class MissingExtraError(ModuleNotFoundError):
    """A library of an extra is not installed; the message holds the command that installs it."""


def not_installed(package: str, extra: str) -> str:
    """Return what is missing and the command for it, in quotes that every shell knows."""
    return f'{package}, which is not installed; pip install "cylinder-friction[{extra}]"'


@contextmanager
def explained() -> Iterator[None]:
    """Raise ``MissingExtraError`` where the block, or the function below, imports a library that is not installed."""
    try:
        yield
    except ModuleNotFoundError as error:
        library = (error.name or "").partition(".")[0]
        if isinstance(error, MissingExtraError) or library not in BROUGHT_BY:
            raise
        raise MissingExtraError(f"this needs {not_installed(library, BROUGHT_BY[library])}", name=error.name) from None
