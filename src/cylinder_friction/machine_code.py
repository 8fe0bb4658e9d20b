"""Compilation with Numba, which keeps machine code on disk. A damaged file or a full disk costs time, but no start.

Numba writes two entry points for each function, one for Python and one for C. Without the unused ones, the first start
of a served model, which compiles, is a sixth faster.
"""

import warnings
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.core.caching import FunctionCache

Function = TypeVar("Function", bound=Callable[..., Any])
_NOT_KEPT = "machine code cannot be kept ({}), so that it is compiled at every start; make room, or set NUMBA_CACHE_DIR"


def compiled(function: Function, **options: Any) -> Function:
    """Compile a function that Python calls."""
    njit: Any = numba.njit  # whose types do not know of the entry points
    made = njit(no_cfunc_wrapper=True, **options)(function)
    try:
        made._cache = _MachineCode(function)
    except RuntimeError as error:  # no folder can be written
        warnings.warn(_NOT_KEPT.format(error), stacklevel=2)
    return cast(Function, made)


def compiled_part(function: Function, **options: Any) -> Function:
    """Compile a function that only compiled functions call."""
    return compiled(function, no_cpython_wrapper=True, **options)


class _MachineCode(FunctionCache):
    """The machine code that Numba keeps of one function."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Read machine code. If that is damaged, or names what another version had, remove all of this folder."""
        try:
            return super().load_overload(sig, target_context)
        except Exception:  # pickle may raise anything
            with suppress(OSError):  # a folder that cannot be written
                for each in Path(self.cache_path).glob("*.nb[ic]"):
                    each.unlink(missing_ok=True)
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep machine code, unless the disk is full."""
        try:
            super().save_overload(sig, data)
        except Exception as error:  # of the disk, or of a damaged file that cannot be removed
            warnings.warn(_NOT_KEPT.format(f"in {self.cache_path}: {error}"), stacklevel=2)
