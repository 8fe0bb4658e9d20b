"""The exported C, compiled with the machine's own compiler and called from Python."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.deployment.c_export.export import ExportedC
from cylinder_friction.realtime.flags import Estimate
from cylinder_friction.realtime.stream import NO_OFFSET

COMPILERS = ("gcc", "clang", "cc")
WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Wdouble-promotion", "-Werror")
OPTIMISED = ("-O3", "-march=native", "-ffp-contract=off")


class NoCompilerError(OSError):
    """There is no C compiler on the PATH, or it refused a source.

    The message names the compilers that were looked for, or holds the compiler's own messages. Install gcc or clang;
    only compiling needs it, exporting C does not.
    """


def find_compiler(names: Sequence[str] = COMPILERS) -> str:
    """Find the first C compiler on the PATH, by default of gcc, clang and cc.

    Use it to find out beforehand whether ``CompiledEstimator`` can work. Raises ``NoCompilerError`` if there is none.
    """
    for name in names:
        found = shutil.which(name)
        if found is not None:
            return found
    raise NoCompilerError(f"no C compiler found; expected one of {', '.join(names)} on the PATH; install gcc or clang")


def compiler_version() -> str:
    """Read the first line in which the first compiler on the PATH names itself and its version.

    Compiled code is only reused with the same compiler. Raises ``NoCompilerError`` if there is none.
    """
    compiler = find_compiler()
    done = subprocess.run([compiler, "--version"], capture_output=True, text=True, check=False)  # noqa: S603
    return done.stdout.partition("\n")[0] or Path(compiler).name


def compile_library(exported: ExportedC, options: Sequence[str] = OPTIMISED) -> Path:
    """Compile an exported source into a shared library beside it, with every warning an error; returns its path.

    Raises:
        NoCompilerError: There is no compiler, or it refused the source; its messages are included.
    """
    library = exported.source.with_suffix(".so")
    compile_shared((exported.source,), library, ("-std=c99", *WARNINGS, *options))
    return library


def compile_shared(sources: Sequence[Path], library: Path, options: Sequence[str]) -> None:
    """Compile C sources into a shared library at the path ``library``, with these compiler options.

    Use it if you link the exported source with sources of your own; for the export alone use ``compile_library``, which
    makes every warning an error. An existing library is overwritten.

    Raises:
        NoCompilerError: There is no compiler, or it refused a source; its messages are included.
    """
    command = [find_compiler(), *options, "-shared", "-fPIC", *map(str, sources), "-o", str(library), "-lm"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603 - the user's compiler
    if done.returncode != 0:
        raise NoCompilerError(f"{command[0]} refused {sources[0].name}:\n{done.stderr}")


class CompiledEstimator:
    """The exported C, compiled on this computer and called from Python; ``stream`` makes any number of instances.

    Use it to check an export against Python, or to run it faster than ``RealTimeStream``. It compiles when it is made,
    which takes seconds, and writes the library beside the source. Raises ``NoCompilerError``.
    """

    def __init__(self, exported: ExportedC) -> None:
        self.exported = exported
        real = ctypes.c_double if exported.real == "double" else ctypes.c_float
        fields = [("friction_n", real), ("lower_n", real), ("upper_n", real), ("flags", ctypes.c_uint32)]
        self.output: type[ctypes.Structure] = type("Output", (ctypes.Structure,), {"_fields_": fields})
        self._loaded = ctypes.CDLL(str(compile_library(exported)))
        state, sample = ctypes.c_void_p, [real] * len(exported.inputs)
        self.init = self._function("init", state)
        self.reset = self._function("reset", state)
        self.warm_up = self._function("warm_up", state, *sample, ctypes.c_uint32)
        self.step = self._function("step", state, *sample, ctypes.POINTER(self.output))
        if exported.learns_offset:
            self.reset_from = self._function("reset_from", state, real, real)
            self.offset_n = self._function("offset_n", state, returns=real)
            self.offset_uncertainty_n = self._function("offset_uncertainty_n", state, returns=real)

    def stream(self) -> CompiledStream:
        """Make a fresh instance."""
        return CompiledStream(self)

    def _function(self, name: str, *arguments: Any, returns: Any = None) -> Any:
        function = self._loaded[f"{self.exported.name}_{name}"]
        function.argtypes, function.restype = arguments, returns
        return function


class CompiledStream:
    """One instance of the compiled C: samples go in one at a time, friction with bounds [N] and flags come out.

    ``CompiledEstimator.stream`` makes it. It has the methods of ``RealTimeStream``. Instances are independent, but each
    is for one thread. A call through ``ctypes`` costs about a microsecond on top of the step.
    """

    def __init__(self, estimator: CompiledEstimator) -> None:
        self._c, size = estimator, estimator.exported.state_bytes
        self._state = ctypes.create_string_buffer(b"\xa5" * size, size)
        self._output = estimator.output()
        estimator.init(self._state)

    def reset(self, offset_n: float = 0.0, uncertainty_n: float | None = None) -> None:
        """Return to the state before the first sample, with this offset of the sensors (see ``RealTimeStream``).

        Raises:
            ValueError: An offset is given, but this estimator learns none.
        """
        if self._c.exported.learns_offset:
            self._c.reset_from(self._state, offset_n, -1.0 if uncertainty_n is None else uncertainty_n)
        elif offset_n != 0.0 or uncertainty_n is not None:
            raise ValueError(NO_OFFSET)
        else:
            self._c.reset(self._state)

    @property
    def offset(self) -> tuple[float, float]:
        """Offset of the sensors' zeros in friction that the next step subtracts, and its standard uncertainty [N]."""
        if not self._c.exported.learns_offset:
            return 0.0, 0.0
        return self._c.offset_n(self._state), self._c.offset_uncertainty_n(self._state)

    def warm_up(self, *sample: float, steps: int) -> None:
        """Reset, then take ``steps`` steps on the same sample."""
        self._c.warm_up(self._state, *sample, steps)

    def step(self, *sample: float) -> Estimate:
        """Estimate at this sample, one number per input; any reading is accepted."""
        self._c.step(self._state, *sample, self._output)
        out = self._output
        return Estimate(out.friction_n, out.lower_n, out.upper_n, out.flags)

    def run(self, samples: Array) -> tuple[Array, NDArray[np.uint32]]:
        """Run samples, shape ``(n, inputs)``: friction, lower and upper bound, ``(n, 3)`` [N], and flags, ``(n,)``."""
        estimates, flags = np.empty((len(samples), 3)), np.empty(len(samples), dtype=np.uint32)
        for row, sample in enumerate(samples.tolist()):
            *estimates[row], flags[row] = self.step(*sample)
        return estimates, flags

    def saved(self) -> bytes:
        """Copy the whole state as bytes."""
        return self._state.raw

    def restore(self, saved: bytes) -> None:
        """Put a saved state back."""
        ctypes.memmove(self._state, saved, len(saved))
