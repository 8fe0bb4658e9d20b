"""The exported C, compiled with the machine's own compiler and called from Python."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.realtime.flags import Estimate

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from cylinder_friction.deployment.c_export.export import ExportedC

    Array = NDArray[np.float64]

COMPILERS = ("gcc", "clang", "cc")
WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Wdouble-promotion", "-Werror")
OPTIMISED = ("-O3", "-march=native", "-ffp-contract=off")


class NoCompilerError(RuntimeError):
    """There is no C compiler, or it refused the source."""


def find_compiler(names: Sequence[str] = COMPILERS) -> str:
    """Return the path of the first compiler that is there.

    Raises:
        NoCompilerError: None is.
    """
    for name in names:
        found = shutil.which(name)
        if found is not None:
            return found
    raise NoCompilerError(f"no C compiler found; expected one of {', '.join(names)} on the PATH; install gcc or clang")


def compile_library(exported: ExportedC, compiler: str | None = None, options: Sequence[str] = OPTIMISED) -> Path:
    """Compile an exported source into a shared library beside it, with every warning an error; returns its path.

    Raises:
        NoCompilerError: There is no compiler, or it refused the source; its messages are included.
    """
    library = exported.source.with_suffix(".so")
    compile_shared((exported.source,), library, ("-std=c99", *WARNINGS, *options), compiler)
    return library


def compile_shared(sources: Sequence[Path], library: Path, options: Sequence[str], compiler: str | None = None) -> None:
    """Compile sources into a shared library.

    Raises:
        NoCompilerError: There is no compiler, or it refused a source; its messages are included.
    """
    command = [compiler or find_compiler(), *options, "-shared", "-fPIC", *map(str, sources), "-o", str(library), "-lm"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603 - the user's compiler
    if done.returncode != 0:
        raise NoCompilerError(f"{command[0]} refused {sources[0].name}:\n{done.stderr}")


@dataclass(frozen=True)
class _Types:
    """How C's types are called here."""

    real: type[ctypes.c_double] | type[ctypes.c_float]
    output: type[ctypes.Structure]


def _types(exported: ExportedC) -> _Types:
    real = ctypes.c_double if exported.real == "double" else ctypes.c_float
    fields = [("friction_n", real), ("lower_n", real), ("upper_n", real), ("flags", ctypes.c_uint32)]
    return _Types(real, type("Output", (ctypes.Structure,), {"_fields_": fields}))


class CompiledEstimator:
    """A compiled library; ``stream`` gives as many instances as wanted.

    Args:
        exported: What ``export_c`` wrote.
        library: What ``compile_library`` made of it; None compiles now.
    """

    def __init__(self, exported: ExportedC, library: Path | None = None) -> None:
        self.exported = exported
        self._types = _types(exported)
        loaded = ctypes.CDLL(str(library or compile_library(exported)))
        real, state = self._types.real, ctypes.c_void_p
        self._init = loaded[f"{exported.name}_init"]
        self._reset = loaded[f"{exported.name}_reset"]
        self._warm_up = loaded[f"{exported.name}_warm_up"]
        self._step = loaded[f"{exported.name}_step"]
        for function, arguments in (
            (self._init, [state]),
            (self._reset, [state]),
            (self._warm_up, [state, real, real, real, ctypes.c_uint32]),
            (self._step, [state, real, real, real, ctypes.POINTER(self._types.output)]),
        ):
            function.argtypes, function.restype = arguments, None

    def stream(self) -> CompiledStream:
        """Return a fresh instance."""
        return CompiledStream(self)


class CompiledStream:
    """One instance: samples go in one at a time, newtons come out."""

    def __init__(self, estimator: CompiledEstimator) -> None:
        self._c = estimator
        self._state = ctypes.create_string_buffer(
            b"\xa5" * estimator.exported.state_bytes, estimator.exported.state_bytes
        )
        self._output = estimator._types.output()
        estimator._init(self._state)

    def reset(self) -> None:
        """Forget everything; the next step is a first step."""
        self._c._reset(self._state)

    def warm_up(self, pressure_1_pa: float, pressure_2_pa: float, position_m: float, steps: int) -> None:
        """Reset, then takes ``steps`` steps on one and the same sample."""
        self._c._warm_up(self._state, pressure_1_pa, pressure_2_pa, position_m, steps)

    def step(self, pressure_1_pa: float, pressure_2_pa: float, position_m: float) -> Estimate:
        """Return the estimate at this sample, whatever the sample is."""
        self._c._step(self._state, pressure_1_pa, pressure_2_pa, position_m, self._output)
        out = self._output
        return Estimate(out.friction_n, out.lower_n, out.upper_n, out.flags)

    def run(self, samples: Array) -> tuple[Array, NDArray[np.uint32]]:
        """Return friction, lower and upper bound, shape ``(n, 3)`` [N], and flags, ``(n,)``, of samples ``(n, 3)``."""
        estimates, flags = np.empty((len(samples), 3)), np.empty(len(samples), dtype=np.uint32)
        for row, sample in enumerate(samples.tolist()):
            *values, said = self.step(*sample)
            estimates[row], flags[row] = values, said
        return estimates, flags

    def saved(self) -> bytes:
        """Return the whole state."""
        return self._state.raw

    def restore(self, saved: bytes) -> None:
        """Put a saved state back."""
        ctypes.memmove(self._state, saved, len(saved))
