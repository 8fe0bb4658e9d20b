"""An estimator as one C99 source and one header."""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass, fields, is_dataclass
from importlib.metadata import version
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from cylinder_friction.deployment.c_export.block import learned_block
from cylinder_friction.deployment.c_export.filters import filter_bank, filter_source
from cylinder_friction.deployment.c_export.header import HEADER, header_values, ordered_fields
from cylinder_friction.deployment.c_export.literals import filled
from cylinder_friction.deployment.c_export.lugre import LugreModel, lugre_block, lugre_model
from cylinder_friction.deployment.c_export.models import model_of, part_of
from cylinder_friction.deployment.c_export.step import GUARD_OPERATIONS, PRELUDE, STEP, guard_fields, step_values
from cylinder_friction.estimators.lugre import LugreEstimator
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.files import write_text

if TYPE_CHECKING:
    from pathlib import Path

    from cylinder_friction.deployment.c_export.literals import Type
    from cylinder_friction.deployment.c_export.models import Part
    from cylinder_friction.estimators.base import FrictionEstimator
    from cylinder_friction.realtime.model import StepModel

Precision = Literal["double", "float"]

_IDENTIFIER = re.compile(r"[a-z][a-z0-9_]*")


@dataclass(frozen=True)
class ExportedC:
    """What was written.

    Attributes:
        header, source: The two files.
        name: Prefix of every public name.
        model: SHA-256 of every number that a step uses.
        inputs: Columns that a step takes, in order.
        real: Type of samples and estimates.
        state_bytes: Size of an instance.
        operations: Multiply-adds, comparisons and the like of one step, at worst.
    """

    header: Path
    source: Path
    name: str
    model: str
    inputs: tuple[str, ...]
    real: Type
    state_bytes: int
    operations: int


def export_c(
    estimator: FrictionEstimator,
    folder: Path,
    name: str = "friction",
    precision: Precision = "double",
    part: Part = "whole",
) -> ExportedC:
    """Write ``name.c`` and ``name.h`` into ``folder``.

    Args:
        estimator: A fitted hybrid, LSTM, forest, force balance, ridge regression or LuGre.
        folder: Made if it is not there.
        name: Prefix of every public name: lower-case letters, digits and underscores.
        precision: Of samples, filters and estimates. ``double`` gives the reference's numbers; ``float`` is for
            processors without double. Network and forest are single in both, as they were trained.

        part: ``lstm`` leaves a hybrid's forest out, ``base`` its network too.

    Raises:
        NotFittedError: There is nothing fitted or loaded yet.
        ValueError: Name, precision or part cannot be.
    """
    kind = estimator.kind if part == "whole" else f"{estimator.kind}, {part} alone"
    if isinstance(estimator, LugreEstimator):
        if part != "whole":
            raise ValueError(f"part must be 'whole' for {estimator.kind}, but got {part!r}")
        return export_model(lugre_model(estimator), folder, name, precision, kind)
    return export_model(part_of(model_of(estimator), part), folder, name, precision, kind)


def export_model(
    model: StepModel | LugreModel,
    folder: Path,
    name: str = "friction",
    precision: Precision = "double",
    kind: str = "hybrid",
) -> ExportedC:
    """Write ``name.c`` and ``name.h`` of a model that is plain arrays already; arguments as for ``export_c``."""
    if not _IDENTIFIER.fullmatch(name):
        raise ValueError(f"name must be lower-case letters, digits and underscores, a letter first, but got {name!r}")
    if precision not in ("double", "float"):
        raise ValueError(f"precision must be 'double' or 'float', but got {precision!r}")
    real: Type = precision
    step = model.step if isinstance(model, LugreModel) else model
    bank = filter_bank(step)
    block = lugre_block(model, bank, real) if isinstance(model, LugreModel) else learned_block(step, bank, real)
    rows = ordered_fields((*guard_fields(bank.lags), *block.fields), real)
    operations = GUARD_OPERATIONS + bank.operations() + block.operations
    values: dict[str, object] = {
        "name": name,
        "NAME": name.upper(),
        "real": real,
        "real_literal": "x##f" if real == "float" else "x",
        "title": f"Friction of a hydraulic cylinder, sample by sample: {kind}, {precision} precision.",
        "version": version("cylinder-friction"),
        "model": fingerprint(model),
        "kind": kind,
        "precision": precision,
        "operations": operations,
        **header_values(step, rows, real),
        **step_values(step, bank, block, real),
    }
    header = filled(HEADER.replace("@ranges@", str(values["ranges"])), values)
    source = filled("\n".join([PRELUDE, filter_source(bank, real), block.code, STEP]), values)
    folder.mkdir(parents=True, exist_ok=True)
    write_text(folder / f"{name}.h", header)
    write_text(folder / f"{name}.c", source)
    return ExportedC(
        folder / f"{name}.h",
        folder / f"{name}.c",
        name,
        str(values["model"]),
        SAMPLE_COLUMNS,
        real,
        sum(row[3] for row in rows),
        operations,
    )


def fingerprint(model: StepModel | LugreModel) -> str:
    """Return the SHA-256 of every number of a model, the same on every machine."""
    digest = hashlib.sha256()
    _add(digest, model)
    return digest.hexdigest()


def _add(digest: Any, value: Any) -> None:
    if is_dataclass(value):
        for field in fields(value):
            digest.update(field.name.encode())
            _add(digest, getattr(value, field.name))
    elif isinstance(value, np.ndarray):
        ordered = np.ascontiguousarray(value, dtype=value.dtype.newbyteorder("<"))
        digest.update(f"{ordered.dtype.str}{ordered.shape}".encode())
        digest.update(ordered.tobytes())
    else:
        digest.update(repr(value).encode())
