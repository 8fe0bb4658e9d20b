"""The exported C, compiled by the machine's compiler."""

from pathlib import Path

import pytest

from cylinder_friction.deployment.c_export.compiled import (
    CompiledEstimator,
    CompiledStream,
    NoCompilerError,
    find_compiler,
)
from cylinder_friction.deployment.c_export.export import Precision, export_model
from cylinder_friction.realtime.model import StepModel


class C:
    """One precision of the C."""

    def __init__(self, precision: Precision) -> None:
        self.name, self._precision = f"c_{precision}", precision
        self._compiled: dict[Path, CompiledEstimator] = {}

    def open(self, model: StepModel, folder: Path) -> CompiledStream:
        try:
            find_compiler()
        except NoCompilerError as missing:
            pytest.skip(str(missing))
        if folder not in self._compiled:
            self._compiled[folder] = CompiledEstimator(export_model(model, folder, precision=self._precision))
        return CompiledStream(self._compiled[folder])


RUNTIMES = [C("double"), C("float")]
