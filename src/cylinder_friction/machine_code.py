"""Where Numba keeps compiled code from one start to the next."""

import atexit
import os
import shutil
import sys
import tempfile
import warnings
from pathlib import Path

FOLDER = "NUMBA_CACHE_DIR"


def give_place() -> None:
    """Give Numba a folder of this process's own where it can write neither beside the package nor in the user's cache.

    Numba refuses to import such a package. A folder that others could write would do, but what lies in it is run.
    """
    if os.environ.get(FOLDER) or _can_write(Path(__file__).parent) or _can_write(_of_user()):
        return
    folder = tempfile.mkdtemp(prefix="cylinder-friction-machine-code-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    os.environ[FOLDER] = folder  # processes that this one starts use it as well
    warnings.warn(
        f"neither {Path(__file__).parent} nor the user's cache can be written, so that code is compiled anew at every "
        f"start, which takes seconds; set {FOLDER} to a folder that only you can write",
        stacklevel=3,
    )


def _of_user() -> Path | None:
    if cache := os.environ.get("XDG_CACHE_HOME"):
        return Path(cache)
    try:
        return Path.home() / ("Library/Caches" if sys.platform == "darwin" else ".cache")
    except RuntimeError:  # an account without a home
        return None


def _can_write(folder: Path | None) -> bool:
    """Return whether files can be written in a folder, or it can be made."""
    if folder is None:
        return False
    return os.access(next(each for each in (folder, *folder.parents) if each.exists()), os.W_OK)
