"""The command ``export``: write a trained estimator as C or an FMU."""

import argparse
from pathlib import Path

from cylinder_friction.deployment.c_export.compiled import NoCompilerError

EXPECTED = (NoCompilerError, ValueError)
PARTS = "part to export; lstm: without the forest; base: only the filtered force balance"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    forms = parser.add_subparsers(dest="what", required=True)
    for name, words, output in (
        ("c", "C99: one source and one header without dependencies, for controllers", "folder for the two files"),
        ("fmu", "FMI: one file for co-simulation, with sources and a binary for this computer", "such as press.fmu"),
    ):
        form = forms.add_parser(name, help=words, description=f"{words}.")
        form.add_argument("model", type=Path, help="folder of the trained estimator, for example models/hybrid")
        form.add_argument("--output", type=Path, required=True, help=output)
        if name == "fmu":
            form.add_argument("--fmi", type=int, choices=(2, 3), default=2, help="version of FMI: 2 for 2.0, 3 for 3.0")
        if name == "c":
            form.add_argument("--name", default="friction", help="prefix of every name, and the files' name")
            form.add_argument("--precision", choices=("double", "float"), default="double", help="of all numbers")
            form.add_argument("--model", dest="part", choices=("whole", "lstm", "base"), default="whole", help=PARTS)
            form.add_argument("--distil", type=int, metavar="NODES", help="first train a smaller LSTM to imitate it")
            form.add_argument("--data", type=Path, default=Path("data/processed"), help="recordings for --distil")


def run(options: argparse.Namespace) -> None:
    {"c": _c, "fmu": _fmu}[options.what](options)


def _c(options: argparse.Namespace) -> None:
    from cylinder_friction.deployment.c_export.export import export_c
    from cylinder_friction.estimators.hybrid import HybridEstimator
    from cylinder_friction.estimators.loading import load_estimator

    estimator = load_estimator(options.model)
    if options.distil is not None:
        from cylinder_friction.deployment.distil import distil_from_folder

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
    from cylinder_friction.deployment.fmu.export import export_fmu
    from cylinder_friction.estimators.loading import load_estimator

    written = export_fmu(load_estimator(options.model), options.output, options.fmi)
    print(f"{written.path}: {written.note}\nmodel    {written.name} {written.token}")
