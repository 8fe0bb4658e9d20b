"""The FMU's binary for this computer, made by whatever C compiler is there."""

from __future__ import annotations

import platform
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from cylinder_friction.deployment.fmu.model_description import FmiVersion

FLAGS = ("-std=c99", "-O3", "-ffp-contract=off", "-fPIC", "-shared", "-fvisibility=hidden")
"""The same numbers on every processor: none fuses a multiplication with an addition."""
COMPILERS = ("gcc", "cc", "clang")
BITS_64 = {"x86_64": "x86_64", "amd64": "x86_64", "arm64": "aarch64", "aarch64": "aarch64"}
SYSTEMS = {
    "Linux": ("linux", "linux64", ".so"),
    "Darwin": ("darwin", "darwin64", ".dylib"),
    "Windows": ("windows", "win64", ".dll"),
}


class CompilerError(Exception):
    """The compiler refused the sources."""


@dataclass(frozen=True)
class Host:
    """Where an FMU keeps the binary for this computer.

    Attributes:
        fmi2, fmi3: Name of the folder in ``binaries/``.
        suffix: Of a shared library.
    """

    fmi2: str
    fmi3: str
    suffix: str

    def folder(self, fmi: FmiVersion) -> str:
        return self.fmi2 if fmi == 2 else self.fmi3


def this_host() -> Host | None:
    """Return None on a computer that FMI has no name for: not of 64 bits, or another system."""
    system, machine = SYSTEMS.get(platform.system()), BITS_64.get(platform.machine().lower())
    if system is None or machine is None:
        return None
    name, fmi2, suffix = system
    fmi3 = f"{machine}-{name}"
    return Host(fmi2 if machine == "x86_64" else fmi3, fmi3, suffix)  # FMI 2.0 knows x86 alone; the rest do as FMI 3.0


def find_compiler() -> str | None:
    """Return the path of the first C compiler found, or None."""
    return next((path for name in COMPILERS if (path := shutil.which(name)) is not None), None)


def compile_library(compiler: str, files: Mapping[str, bytes], to_compile: Sequence[str], suffix: str) -> bytes:
    """Return the shared library made of the sources.

    Args:
        compiler: Path of a compiler that takes gcc's options.
        files: Sources and headers by name.
        to_compile: The sources among them.
        suffix: Of the library.

    Raises:
        CompilerError: With what the compiler said.
    """
    with tempfile.TemporaryDirectory() as folder:
        for name, content in files.items():
            (Path(folder) / name).write_bytes(content)
        library = f"library{suffix}"
        command = [compiler, *FLAGS, "-o", library, *to_compile, "-lm"]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)  # noqa: S603
        if done.returncode != 0:
            raise CompilerError(f"{' '.join(command)}: {done.stderr.strip() or 'failed without a word'}")
        return (Path(folder) / library).read_bytes()
