"""Compilation of the step's functions, without the entry points that nobody calls.

Numba writes two entry points for each function, one for Python and one for C. Without the unused ones, the first start
of a served model, which compiles, is a sixth faster.
"""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function, **options: Any) -> Function:
    """Compile a function that Python calls."""
    njit: Any = numba.njit  # whose types do not know of the entry points
    return cast(Function, njit(cache=True, no_cfunc_wrapper=True, **options)(function))


def compiled_part(function: Function, **options: Any) -> Function:
    """Compile a function that only compiled functions call."""
    return compiled(function, no_cpython_wrapper=True, **options)
