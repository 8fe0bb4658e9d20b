"""How the libraries behind the readers are called: optional ones asked for, their complaints made ours."""

import importlib
import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from cylinder_friction.extras import not_installed
from cylinder_friction.recordings.recording import RecordingError

MOST_UNPACKED = 1100  # DEFLATE packs at most 1032 to 1; a file that claims more than this is damaged


def optional_library(name: str, what: str, extra: str, package: str = "") -> Any:
    """Return a module that only some formats need, or raise ``missing_library``."""
    try:
        return importlib.import_module(name)
    except ImportError:
        raise missing_library(name, what, extra, package) from None


def missing_library(name: str, what: str, extra: str, package: str = "") -> RecordingError:
    """Return the error for a module that is not installed; ``package`` brings it, if not named as the module."""
    return RecordingError(f"reading {what} needs {not_installed(package or name, extra)}")


@contextmanager
def guarded(what: str) -> Iterator[None]:
    """Turn whatever a library raises over a damaged file into a ``RecordingError``, and keeps its warnings quiet.

    These libraries trust what they read, so that damage shows as any exception at all: an index out of range, a key
    that is missing, a size that no memory holds.
    """
    quiet = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            yield
    except RecordingError:
        raise
    except Exception as error:
        text = " ".join(str(error).split())[:300]
        message = f"{type(error).__name__}: {text}" if text else type(error).__name__
        raise RecordingError(
            f"cannot be read as {what} ({message}); it is damaged, cut off or of another kind"
        ) from None
    finally:
        logging.disable(quiet)
