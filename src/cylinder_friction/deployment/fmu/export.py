"""An estimator as an FMU for co-simulation: FMI 2.0 and 3.0 around the exported C, in one file with its sources."""

import hashlib
import io
import platform
import re
import tempfile
import uuid
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

from cylinder_friction.deployment.c_export.compiled import COMPILERS, NoCompilerError, compile_shared, find_compiler
from cylinder_friction.deployment.c_export.export import Precision, c_model, generate_c
from cylinder_friction.deployment.c_export.model_data import LugreModel
from cylinder_friction.deployment.descriptions import flags_of
from cylinder_friction.deployment.fmu.variables import UNITS, fmu_variables
from cylinder_friction.deployment.rendering import render
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.files.whole_files import write_bytes
from cylinder_friction.realtime.flags import Flag
from cylinder_friction.realtime.model import StepModel

FmiVersion = Literal[2, 3]
HEADER = "fmu_model.h"
INTERFACE_FILES = {
    2: ("fmi2.c", "fmi2_absent.h", "fmi2_types.h", "fmu_instance.h", "fmu_states.h"),
    3: ("fmi3.c", "fmi3_absent.h", "fmi3_types.h", "fmu_instance.h", "fmu_states.h"),
}
OPTIONS = ("-std=c99", "-O3", "-ffp-contract=off", "-fvisibility=hidden")
"""Compiler options that give the same numbers on every processor: no fused multiply-adds."""
BITS_64 = {"x86_64": "x86_64", "amd64": "x86_64", "arm64": "aarch64", "aarch64": "aarch64"}
SYSTEMS = {
    "Linux": ("linux", "linux64", ".so"),
    "Darwin": ("darwin", "darwin64", ".dylib"),
    "Windows": ("windows", "win64", ".dll"),
}
EARLIEST = (1980, 1, 1, 0, 0, 0)  # Time of every file in the archive, so that equal content gives equal bytes
UNIX, READABLE = 3, 0o100644


@dataclass(frozen=True)
class ExportedFmu:
    """The FMU that ``export_fmu`` wrote, and what it contains.

    Print ``note``: it states whether there is a binary for this computer, or sources only because no C compiler was
    found. A simulator checks ``token`` when it loads the file; it changes with every number of the model.
    """

    path: Path  # The file
    name: str  # Model identifier
    token: str  # Hash of the model: GUID in FMI 2.0, instantiation token in FMI 3.0
    binary: str | None  # Path of the binary inside, or None if there are sources only
    note: str  # What is inside, and why no binary if there is none


def export_fmu(
    estimator: FrictionEstimator, path: Path, fmi: FmiVersion = 2, precision: Precision = "double"
) -> ExportedFmu:
    """Write the FMU of a fitted estimator: sources, and a binary for this computer if a C compiler is found.

    Args:
        estimator: A fitted estimator of any kind that can be exported to C.
        path: The file; its name becomes the model identifier (see ``model_identifier``).
        fmi: 2 for FMI 2.0, 3 for FMI 3.0.
        precision: As for ``export_c``.

    Raises:
        NotFittedError: The estimator is neither fitted nor loaded.
        ValueError: The estimator cannot run in real time, the file does not end in ``.fmu``, or version or precision
            is not valid.
        NoCompilerError: The compiler refused the sources.
    """
    return export_model_fmu(c_model(estimator), path, fmi, precision, estimator.kind)


def export_model_fmu(
    model: StepModel | LugreModel,
    path: Path,
    fmi: FmiVersion = 2,
    precision: Precision = "double",
    kind: str = "hybrid",
) -> ExportedFmu:
    """Write the FMU of a step model, for a model that you have changed or made yourself.

    Arguments and errors are those of ``export_fmu``; ``kind`` only appears in the file's description. For a fitted
    estimator use ``export_fmu``. The steps equal those of Python within the tolerance of ``precision``.
    """
    if path.suffix != ".fmu":
        raise ValueError(f"expected a file whose name ends in .fmu, but got {path.name!r}")
    if fmi not in (2, 3):
        raise ValueError(f"expected FMI version 2 or 3, but got {fmi}")
    name = model_identifier(path.stem)
    _, texts = generate_c(model, Path(), name, precision, kind)
    sources = {file.name: text.encode() for file, text in texts.items()}
    folder = files(__package__) / "sources"
    sources |= {file: (folder / file).read_bytes() for file in INTERFACE_FILES[fmi]}
    step = model.step if isinstance(model, LugreModel) else model
    values = _values(step, name, kind, fmi)
    token = _token(render(f"fmi{fmi}.xml.j2", token="", **values), sources)
    values["token"] = token
    sources[HEADER] = render("fmu_model.h.j2", **values).encode()
    binary, library, note = _binary(name, sources, fmi)
    content = {f"sources/{file}": text for file, text in sources.items()}
    content["modelDescription.xml"] = render(f"fmi{fmi}.xml.j2", **values).encode()
    content["documentation/index.html"] = render("fmu_documentation.html.j2", **values).encode()
    if fmi == 3:
        content["sources/buildDescription.xml"] = render("fmi3_build.xml.j2", **values).encode()
    if binary is not None:
        content[binary] = library
    write_bytes(path, _packed(content))
    return ExportedFmu(path, name, token, binary, note)


def model_identifier(stem: str) -> str:
    """Turn a file's name into a C identifier in lower case, with the prefix ``friction_`` if it could not be one.

    Names that begin with fmi or fmu get the prefix too, as they belong to the C around the estimator. ``export_fmu``
    uses the result as the model identifier, which simulators show.

    Example:
        >>> from cylinder_friction.deployment.fmu.export import model_identifier
        >>> model_identifier("press 80-45")
        'press_80_45'
    """
    name = re.sub(r"[^a-z0-9]+", "_", stem.lower()).strip("_") or "model"
    return name if re.match(r"(?!fm[iu])[a-z]", name) else f"friction_{name}"


def _values(model: StepModel, name: str, kind: str, fmi: FmiVersion) -> dict[str, Any]:
    """Collect the values of the templates, without the token."""
    variables = fmu_variables(model)
    inputs = [variable for variable in variables if variable.causality == "input"]
    references = {variable.name: reference for reference, variable in enumerate(variables)}
    flags = [str(flag.name).lower() for flag in flags_of(model)]
    places = {"first_input": references[inputs[0].name], "first_flag": references[flags[0]]}
    for name_of in [*flags, *(variable.name for variable in inputs)]:
        del references[name_of]
    return {
        "name": name,
        "description": f"Friction inside a hydraulic cylinder from raw samples of its sensors: {kind}"
        + ("" if model.trained_for is None else f", trained for {model.trained_for.in_words()}")
        + (f"; it takes readings of the sensors, and from them {applied}" if (applied := model.applied()) else ""),
        "version": version("cylinder-friction"),
        "sample_time_s": repr(float(model.sample_time_s)),
        "variables": variables,
        "inputs": inputs,
        "units": UNITS,
        "source_files": (f"{name}.c", f"fmi{fmi}.c"),
        "flags": len(flags),
        "learns_offset": model.offset is not None,
        "not_ready": Flag.NOT_READY.value,
        "references": references | places,
    }


def _token(description: str, sources: Mapping[str, bytes]) -> str:
    """Hash everything in the FMU except the binary, in the form of a GUID."""
    digest = hashlib.sha256(description.encode())
    for name in sorted(sources):
        digest.update(f"\0{name}\0{len(sources[name])}\0".encode() + sources[name])
    return f"{{{uuid.UUID(bytes=digest.digest()[:16])}}}"


def _binary(name: str, sources: Mapping[str, bytes], fmi: FmiVersion) -> tuple[str | None, bytes, str]:
    """Compile the binary: its path, its bytes, and a sentence on it; the path is None if there is none."""
    system, machine = SYSTEMS.get(platform.system()), BITS_64.get(platform.machine().lower())
    if system is None or machine is None:
        return None, b"", "sources only: FMI has no name for this computer; the host program must compile them"
    try:
        find_compiler()
    except NoCompilerError:
        missing = f"no C compiler ({', '.join(COMPILERS)}) was found here; install one and export again"
        return None, b"", f"sources only: {missing}"
    own, fmi2, suffix = system
    # FMI 2.0 names only x86 platforms; for other processors the names of FMI 3.0 are used
    folder = fmi2 if fmi == 2 and machine == "x86_64" else f"{machine}-{own}"
    with tempfile.TemporaryDirectory() as scratch:
        for file, content in sources.items():
            (Path(scratch) / file).write_bytes(content)
        library = Path(scratch) / f"library{suffix}"
        compile_shared([Path(scratch) / f"{name}.c", Path(scratch) / f"fmi{fmi}.c"], library, OPTIONS)
        content = library.read_bytes()
    return f"binaries/{folder}/{name}{suffix}", content, f"sources, and a binary for {folder}"


def _packed(content: Mapping[str, bytes]) -> bytes:
    """Zip ``content`` in alphabetical order of its paths, without times of writing."""
    buffer = io.BytesIO()
    with ZipFile(buffer, "w") as archive:
        for path in sorted(content):
            entry = ZipInfo(path, EARLIEST)
            entry.compress_type, entry.create_system, entry.external_attr = ZIP_DEFLATED, UNIX, READABLE << 16
            archive.writestr(entry, content[path])
    return buffer.getvalue()
