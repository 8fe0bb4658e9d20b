"""Optional libraries: the extra of the package that brings each, and the message if it is missing."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from cylinder_friction.refusal import RefusalError

BROUGHT_BY = {
    "torch": ("train", "pipeline"),
    "sklearn": ("train", "pipeline"),
    "mlflow": ("serve", "pipeline"),
    "optuna": ("pipeline",),
    "hydra": ("pipeline",),
    "omegaconf": ("pipeline",),
    "dvc": ("pipeline",),
    "dvc_data": ("pipeline",),
    "dvc_objects": ("pipeline",),
    "distributed": ("cluster",),
    "threadpoolctl": ("cluster",),
}
"""The extras that bring each module, the smallest first; readers of formats name theirs themselves."""


class MissingExtraError(RefusalError, ModuleNotFoundError):
    """A library of an extra is not installed; the message holds the command that installs it."""


def not_installed(package: str, extra: str) -> str:
    """State what is missing and the command that installs it, in quotes that every shell knows."""
    return f'{package}, which is not installed; pip install "cylinder-friction[{extra}]"'


@contextmanager
def explained(wanted: str = "") -> Iterator[None]:
    """Raise ``MissingExtraError`` if the block, or the function below, imports a library that is not installed.

    The error names the extra ``wanted``, which brings everything for this work, if that extra brings the library.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        library = (error.name or "").partition(".")[0]
        extras = BROUGHT_BY.get(library, ())
        if not extras or (isinstance(error, MissingExtraError) and wanted not in extras):
            raise
        extra = wanted if wanted in extras else extras[0]
        raise MissingExtraError(f"this needs {not_installed(library, extra)}", name=error.name) from None
