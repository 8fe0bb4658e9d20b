"""The command ``export``: write a trained estimator as C or an FMU."""

import argparse

from cylinder_friction.deployment.c_export.compiled import NoCompilerError
from cylinder_friction.deployment.c_export.export import export_c
from cylinder_friction.deployment.distil import distil_from_folder
from cylinder_friction.deployment.fmu.export import export_fmu
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.loading import load_estimator

EXPECTED = (NoCompilerError, ValueError)


def run(options: argparse.Namespace) -> None:
    {"c": _c, "fmu": _fmu}[options.what](options)


def _c(options: argparse.Namespace) -> None:
    estimator = load_estimator(options.model)
    if options.distil is not None:
        if not isinstance(estimator, HybridEstimator):
            raise ValueError(f"--distil needs a hybrid, but got {estimator.kind}")
        estimator, report = distil_from_folder(estimator, options.distil, options.data)
        print(report.text())
    written = export_c(estimator, options.output, options.name, options.precision, options.part)
    for path in (written.header, written.source):
        print(f"{path}: {path.stat().st_size / 1e3:.0f} kB")
    print(f"state    {written.state_bytes} bytes per instance\nstep     {written.operations} operations")
    print(f"model    {written.model}")


def _fmu(options: argparse.Namespace) -> None:
    written = export_fmu(load_estimator(options.model), options.output, options.fmi)
    print(f"{written.path}: {written.note}\nmodel    {written.name} {written.token}")
