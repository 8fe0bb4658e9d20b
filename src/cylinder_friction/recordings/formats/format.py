"""What a file format is to the package: how it is recognized, what reads it, and what that needs."""

import logging
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np

from cylinder_friction.extras import not_installed
from cylinder_friction.recordings.formats.logged_table import LoggedTable, LongTable
from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.wording import in_brief


@dataclass(frozen=True)
class Format:
    """One file format. A module beside this one defines it, and ``reading.FORMATS`` lists it."""

    name: str
    what: str  # In messages: ``an HDF5 file``
    # Returns the tables of a ``FileSource`` with the wanted channels. For ``options`` it takes ``CsvOptions`` too.
    read: Callable[..., list[LoggedTable]]
    starts: tuple[bytes, ...] = ()  # How its files begin
    fits: Callable[[bytes], bool] | None = None  # Whether a file with this head has the format, beyond ``starts``
    setting: str = ""  # What a configuration calls it, if two formats share that; empty for its name
    library: str = ""  # The library that only this format needs, and the extra of this package that brings it
    extra: str = ""
    # Reads a file of more rows than its last argument in parts; None if it has fewer. Other arguments as for ``read``.
    read_long: Callable[..., LongTable | None] | None = None
    options: bool = False
    databases: bool = False  # Whether ``read`` takes the path of a bus's database, or None, as its last argument
    # What crashes over a damaged file, in messages. Such a format is read in an isolated process; others are not.
    crashes: str = ""

    @property
    def configured(self) -> str:
        """The name by which a configuration asks for it."""
        return self.setting or self.name

    def refuse_missing_library(self) -> None:
        """Raise ``RecordingError`` with the command that installs the library this format needs."""
        if self.library and find_spec(self.library) is None:
            raise RecordingError(f"reading {self.what} needs {not_installed(self.library, self.extra)}")


@contextmanager
def guarded(what: str) -> Iterator[None]:
    """Turn whatever a library raises over a damaged file into a ``RecordingError``, and keep its warnings quiet."""
    quiet = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            yield
    except RecordingError:
        raise
    except Exception as error:
        message = f"{type(error).__name__}: {in_brief(error, 300)}".removesuffix(": ")
        raise RecordingError(
            f"cannot be read as {what} ({message}); it is damaged, cut off or of another kind"
        ) from None
    finally:
        logging.disable(quiet)
