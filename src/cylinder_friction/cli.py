"""The command line: ``cylinder-friction COMMAND``."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from cylinder_friction.params import ParamsError
from cylinder_friction.recordings import RecordingError
from cylinder_friction.tracking.errors import TrackingError

if TYPE_CHECKING:
    from collections.abc import Sequence

CONF = Path("conf")
REPORTS = Path("reports")


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command; returns 0, or 1 with a message where the user can do something about it."""
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


def _stage(options: argparse.Namespace) -> None:
    from cylinder_friction.stages._run import run_stage

    run_stage(options.name)


def _params(options: argparse.Namespace) -> None:
    from cylinder_friction.composition import write_params

    write_params(CONF, options.overrides)


def _check(_options: argparse.Namespace) -> None:
    from cylinder_friction.params import load_params

    load_params()


def _ingest_init(options: argparse.Namespace) -> None:
    from cylinder_friction.inspection import guess_mapping, mapping_yaml
    from cylinder_friction.recordings import read_logged_file, write_text

    text = mapping_yaml(guess_mapping(read_logged_file(options.file), options.file))
    if options.output is None:
        print(text, end="")
        return
    if options.output.exists():
        raise FileExistsError(f"{options.output}: is there already; name another file, or remove it first")
    write_text(options.output, text)
    print(f"{options.output}: read every line that says guess, CHECK, AMBIGUOUS or NOT FOUND")


def _inspect(options: argparse.Namespace) -> int:
    from cylinder_friction.composition import compose_params
    from cylinder_friction.params import check_params, load_params
    from cylinder_friction.stages.inspect import inspect_path

    params = check_params(compose_params(CONF, options.overrides), "conf") if options.overrides else load_params()
    report, refused = inspect_path(options.path, params, options.output)
    print(f"{report}\n\npage     {options.output}")
    return 1 if refused else 0


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
    from cylinder_friction.readme import update_readme

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
