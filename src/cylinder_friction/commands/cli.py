"""The command line: ``cylinder-friction COMMAND``."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.params.checking import ParamsError
from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.tracking.errors import TrackingError

if TYPE_CHECKING:
    from collections.abc import Sequence

CONF = Path("conf")
REPORTS = Path("reports")
GOLDEN = Path("tests/golden")
PROCESSED = Path("data/processed")
EXPORT_PART = "lstm: without the forest; base: the filtered force balance alone"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns 0, or 1 with a message where the user can do something about it."""
    options = _parser().parse_args(arguments)
    try:
        return int(options.run(options) or 0)
    except (ParamsError, RecordingError, TrackingError, FileNotFoundError, FileExistsError) as error:
        what = f"stage {options.name}" if options.command == "stage" else options.command
        print(f"cylinder-friction {what}: {error}", file=sys.stderr)
        return 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="cylinder-friction", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    stage = commands.add_parser("stage", help="run one stage of the pipeline (dvc.yaml calls this)")
    stage.add_argument("name")
    stage.set_defaults(run=_stage)
    params = commands.add_parser("params", help="compose conf/ into params.yaml, with Hydra overrides")
    params.add_argument("overrides", nargs="*", help="for example experiment=smoke search.trials=5")
    params.set_defaults(run=_params)
    commands.add_parser("check", help="check params.yaml").set_defaults(run=_check)
    _add_files_commands(commands)
    commands.add_parser("track", help="log every finished stage to MLflow, without duplicates").set_defaults(run=_track)
    commands.add_parser("summary", help="print the comparison table and where things lie").set_defaults(run=_summary)
    commands.add_parser("readme", help="put the latest table and picture into README.md").set_defaults(run=_readme)
    lineage = commands.add_parser("lineage", help="print and check the way back from a model to its data")
    lineage.add_argument("model", help="for example models:/friction-estimator@champion")
    lineage.set_defaults(run=_lineage)
    commands.add_parser("ui", help="open the MLflow UI on the runs").set_defaults(run=_ui)
    _add_golden_commands(commands)
    _add_export_commands(commands)
    latency = commands.add_parser("latency", help="measure the cost of one step in every runtime on this machine")
    latency.add_argument("models", nargs="*", type=Path, help="folders of estimators; without: the pipeline's own")
    latency.add_argument("--steps", type=int, default=100_000, help="timed steps per runtime, as far as time allows")
    latency.set_defaults(run=_latency)
    serve = commands.add_parser("serve", help="serve the champion and print a curl to try")
    serve.add_argument("--model", default="models:/friction-estimator@champion")
    serve.set_defaults(run=_serve)
    return parser


def _add_files_commands(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    ingest = commands.add_parser("ingest", help="ingest init FILE: write a first mapping for a logger's file")
    init = ingest.add_subparsers(dest="what", required=True).add_parser("init", help="write a first mapping")
    init.add_argument("file", type=Path)
    init.add_argument("--output", type=Path, help="for example conf/ingest/press.yaml; without it, it is printed")
    init.set_defaults(run=_ingest_init)
    inspect = commands.add_parser("inspect", help="check a logger's file or a folder of them, and draw a page")
    inspect.add_argument("path", type=Path)
    inspect.add_argument("overrides", nargs="*", help="for example ingest=own cylinder=press; without: params.yaml")
    inspect.add_argument("--output", type=Path, default=REPORTS / "inspection.html")
    inspect.set_defaults(run=_inspect)


def _add_golden_commands(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    golden = commands.add_parser("golden", help="the trajectories that every real-time runtime must meet")
    what = golden.add_subparsers(dest="what", required=True)
    for name, text in (
        ("train", "train their small model anew; then record"),
        ("record", "record them anew from the test recordings"),
        ("check", "compare what Python makes of them with what was recorded"),
    ):
        command = what.add_parser(name, help=text)
        command.add_argument("--folder", type=Path, default=GOLDEN)
        command.set_defaults(run=_golden)


def _add_export_commands(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    export = commands.add_parser("export", help="write a trained estimator in another form, for use elsewhere")
    forms = export.add_subparsers(dest="what", required=True)
    onnx = forms.add_parser("onnx", help="ONNX: the whole estimator as a step graph and as a sequence graph")
    onnx.add_argument("model", type=Path, help="folder of the trained estimator, for example models/hybrid")
    onnx.add_argument("--output", type=Path, required=True, help="folder for step.onnx and sequence.onnx")
    onnx.set_defaults(run=_export_onnx)
    c = forms.add_parser("c", help="C99: one source and one header without dependencies, for controllers")
    c.add_argument("model", type=Path, help="folder of the trained estimator, for example models/hybrid")
    c.add_argument("--output", type=Path, required=True, help="folder for the two files")
    c.add_argument("--name", default="friction", help="prefix of every name, and the files' name")
    c.add_argument("--precision", choices=("double", "float"), default="double", help="of samples, filters, estimates")
    c.add_argument("--model", dest="part", choices=("whole", "lstm", "base"), default="whole", help=EXPORT_PART)
    c.add_argument("--distil", type=int, metavar="NODES", help="first teach a single-layer LSTM of so many nodes to it")
    c.add_argument(
        "--data", type=Path, default=PROCESSED, help="labelled recordings for --distil: train, validation, test"
    )
    c.set_defaults(run=_export_c)
    fmu = forms.add_parser("fmu", help="FMI: one file for co-simulation, with sources and a binary for this computer")
    fmu.add_argument("model", type=Path, help="folder of the trained estimator, for example models/hybrid")
    fmu.add_argument("--output", type=Path, required=True, help="the file, for example press.fmu")
    fmu.add_argument("--fmi", type=int, choices=(2, 3), default=2, help="version of FMI: 2 for 2.0, 3 for 3.0")
    fmu.set_defaults(run=_export_fmu)


def _stage(options: argparse.Namespace) -> None:
    from cylinder_friction.stages._run import run_stage

    run_stage(options.name)


def _params(options: argparse.Namespace) -> None:
    from cylinder_friction.commands.params import write_params

    write_params(CONF, options.overrides)


def _check(_options: argparse.Namespace) -> None:
    from cylinder_friction.params.checking import load_params

    load_params()


def _ingest_init(options: argparse.Namespace) -> None:
    from cylinder_friction.recordings.files import write_text
    from cylinder_friction.recordings.formats.reading import read_logged_file
    from cylinder_friction.recordings.mapping.guessing import guess_mapping
    from cylinder_friction.recordings.mapping.mapping_text import mapping_yaml

    text = mapping_yaml(guess_mapping(read_logged_file(options.file), options.file))
    if options.output is None:
        print(text, end="")
        return
    if options.output.exists():
        raise FileExistsError(f"{options.output}: is there already; name another file, or remove it first")
    write_text(options.output, text)
    print(f"{options.output}: read every line marked guess, CHECK, AMBIGUOUS or NOT FOUND")


def _inspect(options: argparse.Namespace) -> int:
    from cylinder_friction.commands.inspect import inspect_path
    from cylinder_friction.commands.params import compose_params
    from cylinder_friction.params.checking import check_params, load_params

    params = check_params(compose_params(CONF, options.overrides), "conf") if options.overrides else load_params()
    report, refused = inspect_path(options.path, params, options.output)
    print(f"{report}\n\npage     {options.output}")
    return 1 if refused else 0


def _golden(options: argparse.Namespace) -> int:
    from cylinder_friction.commands.golden import check_golden, record_golden, train_golden_model

    if options.what == "check":
        report, same = check_golden(options.folder)
        print(report)
        return 0 if same else 1
    if options.what == "train":
        from cylinder_friction.params.checking import load_params

        train_golden_model(options.folder, load_params())
    else:
        print(record_golden(options.folder))
    return 0


def _latency(options: argparse.Namespace) -> int:
    from cylinder_friction.commands.latency import measure_latency
    from cylinder_friction.deployment.c_export.compiled import NoCompilerError
    from cylinder_friction.deployment.latency.measuring import Effort

    try:
        print(measure_latency(options.models, Effort(options.steps)))
    except (NoCompilerError, ValueError) as error:
        print(f"cylinder-friction latency: {error}", file=sys.stderr)
        return 1
    return 0


def _export_onnx(options: argparse.Namespace) -> int:
    from cylinder_friction.deployment.onnx_graphs.export import export_onnx

    try:
        written = export_onnx(load_estimator(options.model), options.output)
    except ValueError as error:
        print(f"cylinder-friction export onnx: {error}", file=sys.stderr)
        return 1
    for path in (written.step, written.sequence):
        print(f"{path}: {path.stat().st_size / 1e3:.0f} kB")
    print(f"model    {written.model}")
    return 0


def _export_c(options: argparse.Namespace) -> int:
    from cylinder_friction.deployment.c_export.export import export_c
    from cylinder_friction.estimators.hybrid import HybridEstimator

    estimator = load_estimator(options.model)
    try:
        if options.distil is not None:
            from cylinder_friction.deployment.distil import distil_from_folder

            if not isinstance(estimator, HybridEstimator):
                raise ValueError(f"--distil needs a hybrid as teacher, but got {estimator.kind}")
            estimator, report = distil_from_folder(estimator, options.distil, options.data)
            print(report.text())
        written = export_c(estimator, options.output, options.name, options.precision, options.part)
    except ValueError as error:
        print(f"cylinder-friction export c: {error}", file=sys.stderr)
        return 1
    for path in (written.header, written.source):
        print(f"{path}: {path.stat().st_size / 1e3:.0f} kB")
    print(f"state    {written.state_bytes} bytes an instance\nstep     {written.operations} operations")
    print(f"model    {written.model}")
    return 0


def _export_fmu(options: argparse.Namespace) -> int:
    from cylinder_friction.deployment.fmu.compiling import CompilerError
    from cylinder_friction.deployment.fmu.exporting import export_fmu

    try:
        written = export_fmu(load_estimator(options.model), options.output, options.fmi)
    except (CompilerError, ValueError) as error:
        print(f"cylinder-friction export fmu: {error}", file=sys.stderr)
        return 1
    print(f"{written.path}: {written.note}\nmodel    {written.name} {written.token}")
    return 0


def _track(_options: argparse.Namespace) -> None:
    from cylinder_friction.tracking.replay import replay

    print(replay(Path.cwd()).summary())


def _summary(_options: argparse.Namespace) -> None:
    print((REPORTS / "table.md").read_text(encoding="utf-8").rstrip())
    print(
        f"""
report   {REPORTS / "report.html"}
figures  {REPORTS / "figures"}

next     make ui      browse the runs, the search and the registered model
         make serve   serve the champion and try it with curl"""
    )


def _readme(_options: argparse.Namespace) -> None:
    from cylinder_friction.commands.readme import update_readme

    update_readme(Path("README.md"), REPORTS)


def _lineage(options: argparse.Namespace) -> int:
    from cylinder_friction.tracking.lineage import lineage

    report = lineage(options.model, Path.cwd())
    print(report.text())
    return 0 if report.holds else 1


def _ui(_options: argparse.Namespace) -> int:
    from cylinder_friction.deployment.serve import run_ui

    return run_ui(Path.cwd())


def _serve(options: argparse.Namespace) -> int:
    from cylinder_friction.deployment.serve import run_server

    return run_server(options.model, Path.cwd())


if __name__ == "__main__":
    sys.exit(main())
