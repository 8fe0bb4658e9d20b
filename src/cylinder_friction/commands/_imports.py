"""Imports of a command that is over within a second or two."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count

_calls = count()


@contextmanager
def staying() -> Iterator[None]:
    """Import modules without looking for garbage in what they define, neither now nor later: all of it stays.

    Python looks through the hundred thousands of objects of pandas again and again otherwise, which takes a tenth of a
    short command's time. Only the first call of a process imports anything; the others do nothing.
    """
    if next(_calls) or not gc.isenabled():
        yield
        return
    gc.disable()
    try:
        yield
        gc.freeze()
    finally:
        gc.enable()
