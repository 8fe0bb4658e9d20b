"""An estimator as an FMU for co-simulation, in one file."""

from __future__ import annotations

import re
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from cylinder_friction.deployment.c_export.export import export_model
from cylinder_friction.deployment.c_export.lugre import LugreModel, lugre_model
from cylinder_friction.deployment.c_export.models import model_of
from cylinder_friction.deployment.fmu.building import EstimatorInC, build_fmu
from cylinder_friction.estimators.lugre import LugreEstimator

if TYPE_CHECKING:
    from cylinder_friction.deployment.c_export.export import Precision
    from cylinder_friction.deployment.fmu.model_description import FmiVersion
    from cylinder_friction.estimators.base import FrictionEstimator
    from cylinder_friction.realtime.model import StepModel


@dataclass(frozen=True)
class ExportedFmu:
    """What was written.

    Attributes:
        path: The file.
        name: Model identifier.
        token: Fingerprint of the model: GUID in FMI 2.0, instantiation token in FMI 3.0.
        binary: Path of the binary inside, or None where there are sources only.
        note: What is inside, and why no binary where there is none.
    """

    path: Path
    name: str
    token: str
    binary: str | None
    note: str


def export_fmu(
    estimator: FrictionEstimator, path: Path, fmi: FmiVersion = 2, precision: Precision = "double"
) -> ExportedFmu:
    """Write the FMU of a fitted estimator: sources, and a binary for this computer where a C compiler is found.

    Args:
        estimator: Of any kind that can be exported to C.
        path: The file; its name without ending, made a C identifier, becomes the model identifier.
        fmi: 2 for FMI 2.0, 3 for FMI 3.0.
        precision: As for ``export_c``.

    Raises:
        NotFittedError: There is nothing fitted or loaded yet.
        ValueError: The file does not end in ``.fmu``, or version or precision cannot be.
        CompilerError: The compiler refused the sources.
    """
    model = lugre_model(estimator) if isinstance(estimator, LugreEstimator) else model_of(estimator)
    return export_model_fmu(model, path, fmi, precision, estimator.kind)


def export_model_fmu(
    model: StepModel | LugreModel,
    path: Path,
    fmi: FmiVersion = 2,
    precision: Precision = "double",
    kind: str = "hybrid",
) -> ExportedFmu:
    """Write the FMU of a model that is plain arrays already; arguments and errors as for ``export_fmu``."""
    if path.suffix != ".fmu":
        raise ValueError(f"expected a file whose name ends in .fmu, but got {path.name!r}")
    name = model_identifier(path.stem)
    with tempfile.TemporaryDirectory() as folder:
        written = export_model(model, Path(folder), name, precision, kind)
        in_c = EstimatorInC(name, written.header.read_text("utf-8"), written.source.read_text("utf-8"), kind)
    built = build_fmu(in_c, model.step if isinstance(model, LugreModel) else model, fmi)
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(f".{path.name}.draft")
    draft.write_bytes(built.content)
    draft.replace(path)
    return ExportedFmu(path, name, built.token, built.binary, built.note)


def model_identifier(stem: str) -> str:
    """Return a file's name as a C identifier in lower case, ``friction_`` before it where it could not be one."""
    name = re.sub(r"[^a-z0-9]+", "_", stem.lower()).strip("_") or "model"
    return name if re.match(r"(?!fm[iu])[a-z]", name) else f"friction_{name}"
