"""Compilation of the step's functions, without the entry points that nobody calls.

Numba writes two entry points for each function, one for Python and one for C. Without the unused ones, the first start
of a served model, which compiles, is a sixth faster.
"""

from collections.abc import Callable
from contextlib import suppress
from typing import Any, TypeVar, cast

import numba
from numba.core.caching import IndexDataCacheFile

Function = TypeVar("Function", bound=Callable[..., Any])


def _index(file: Any, load: Callable[[Any], Any] = IndexDataCacheFile._load_index) -> Any:
    """Load Numba's index of compiled code; empty if it names types of this package that are gone since an upgrade."""
    with suppress(AttributeError, ImportError):
        return load(file)
    return {}


IndexDataCacheFile._load_index = _index


def compiled(function: Function, **options: Any) -> Function:
    """Compile a function that Python calls."""
    njit: Any = numba.njit  # whose types do not know of the entry points
    return cast(Function, njit(cache=True, no_cfunc_wrapper=True, **options)(function))


def compiled_part(function: Function, **options: Any) -> Function:
    """Compile a function that only compiled functions call."""
    return compiled(function, no_cpython_wrapper=True, **options)
