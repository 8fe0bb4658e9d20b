"""From the estimator in C to the whole FMU."""

from __future__ import annotations

import hashlib
import re
import uuid
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from cylinder_friction.deployment.fmu.compiling import compile_library, find_compiler, this_host
from cylinder_friction.deployment.fmu.documentation import documentation
from cylinder_friction.deployment.fmu.model_description import FmuFacts, build_description, model_description
from cylinder_friction.deployment.fmu.packing import packed
from cylinder_friction.deployment.fmu.sources import interface_sources, model_header
from cylinder_friction.deployment.fmu.variables import fmu_variables

if TYPE_CHECKING:
    from collections.abc import Mapping

    from cylinder_friction.deployment.fmu.model_description import FmiVersion
    from cylinder_friction.realtime.model import StepModel

HEADER = "fmu_model.h"
NAME = re.compile(r"(?!fm[iu])[a-z][a-z0-9_]*")
"""Names that begin with fmi or fmu belong to the C around the estimator."""


@dataclass(frozen=True)
class EstimatorInC:
    """The exported estimator.

    Attributes:
        name: Prefix of its functions, and its files' name.
        header, source: Text of ``NAME.h`` and ``NAME.c``.
        kind: Kind of estimator, for the description.
    """

    name: str
    header: str
    source: str
    kind: str


@dataclass(frozen=True)
class BuiltFmu:
    """An FMU.

    Attributes:
        content: Bytes of the file.
        token: Fingerprint of the model: GUID in FMI 2.0, instantiation token in FMI 3.0.
        binary: Path of the binary inside, or None where there are sources only.
        note: What is inside, and why no binary where there is none; one sentence.
    """

    content: bytes
    token: str
    binary: str | None
    note: str


def build_fmu(estimator: EstimatorInC, model: StepModel, fmi: FmiVersion) -> BuiltFmu:
    """Return the FMU of an exported estimator, with a binary for this computer where a C compiler is found.

    Args:
        estimator: The estimator in C.
        model: What it was made of: sample time, ranges and bounds are described from it.
        fmi: 2 for FMI 2.0, 3 for FMI 3.0.

    Raises:
        ValueError: The version or the name cannot be taken.
        CompilerError: The compiler refused the sources.
    """
    if fmi not in (2, 3):
        raise ValueError(f"expected FMI version 2 or 3, but got {fmi}")
    if NAME.fullmatch(estimator.name) is None:
        raise ValueError(
            "expected as the model's name lower-case letters, digits and underscores, beginning with a letter but with "
            f"neither fmi nor fmu, but got {estimator.name!r}"
        )
    facts = FmuFacts(
        estimator.name,
        "",
        f"Friction inside a hydraulic cylinder from two pressures and a position: {estimator.kind}",
        model.sample_time_s,
        fmu_variables(model),
        (f"{estimator.name}.c", f"fmi{fmi}.c"),
    )
    sources = {
        f"{estimator.name}.c": estimator.source.encode(),
        f"{estimator.name}.h": estimator.header.encode(),
        **interface_sources(fmi),
    }
    facts = replace(facts, token=_fingerprint(facts, sources, fmi))
    sources[HEADER] = model_header(estimator.name, facts.token, model.sample_time_s, facts.variables)
    binary, library, note = _binary(facts, sources, fmi)
    content = {f"sources/{name}": text for name, text in sources.items()}
    content["modelDescription.xml"] = model_description(facts, fmi)
    content["documentation/index.html"] = documentation(facts)
    if fmi == 3:
        content["sources/buildDescription.xml"] = build_description(facts)
    if binary is not None:
        content[binary] = library
    return BuiltFmu(packed(content), facts.token, binary, note)


def _fingerprint(facts: FmuFacts, sources: Mapping[str, bytes], fmi: FmiVersion) -> str:
    """Return a hash of all that goes into the FMU but the binary, written as a GUID is."""
    digest = hashlib.sha256(model_description(facts, fmi))
    for name in sorted(sources):
        digest.update(f"\0{name}\0{len(sources[name])}\0".encode() + sources[name])
    return f"{{{uuid.UUID(bytes=digest.digest()[:16])}}}"


def _binary(facts: FmuFacts, sources: Mapping[str, bytes], fmi: FmiVersion) -> tuple[str | None, bytes, str]:
    """Return path and bytes of the binary, and a sentence on it; None where this computer cannot make one."""
    host, compiler = this_host(), find_compiler()
    if host is None:
        return None, b"", "sources only: FMI has no name for this computer; the host program must compile them"
    if compiler is None:
        return None, b"", "sources only: no C compiler (gcc, cc, clang) was found here; install one and export again"
    library = compile_library(compiler, sources, facts.source_files, host.suffix)
    path = f"binaries/{host.folder(fmi)}/{facts.name}{host.suffix}"
    return path, library, f"sources, and a binary for {host.folder(fmi)}"
