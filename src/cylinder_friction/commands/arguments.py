"""The arguments of every command. The work of a command has a module of its own, which is imported after parsing.

So help, completion and mistyped options import no library, and need no extra.
"""

import argparse
import ast
from collections.abc import Callable
from pathlib import Path

COMMANDS = {
    "init": "make a project's folder: configuration, pipeline and an example log",
    "stage": "run one stage of the pipeline (dvc.yaml calls this)",
    "code": "write code.yaml, the hashes of the code that the stages run (dvc.yaml calls this)",
    "params": "compose conf/ into params.yaml, with Hydra overrides",
    "check": "check params.yaml and this folder for what would fail later",
    "ingest": "write a first mapping for a logger's file: ingest init FILE",
    "estimate": "estimate friction from log files: a result per recording and a page",
    "identify": "identify friction models from log files: Stribeck curve, LuGre, files for Modelica and MATLAB",
    "adapt": "adapt a model to another cylinder from a few of its logs",
    "inspect": "check log files and draw a page",
    "track": "log every finished stage to MLflow, without duplicates",
    "summary": "print the comparison table and where its files are",
    "readme": "put the latest table and picture into README.md",
    "lineage": "print and check where a model came from",
    "promote": "make a version the champion",
    "rollback": "make the previous champion the champion again",
    "ui": "open the MLflow UI on the runs",
    "serve": "serve the champion and print a curl to try",
    "export": "export a trained estimator to C or an FMU",
}
EXAMPLE_CYLINDER = "bore_diameter_m=0.063,rod_diameter_m=0.028,stroke_m=0.25,moving_mass_kg=6"
FEW_FILES = 200
"""Number of logs from which other processes pay; fewer are read before processes would have started."""
_STAGES_FOLDER = Path(__file__).parents[1] / "stages"


def add_arguments(parser: argparse.ArgumentParser, command: str) -> None:
    """Add the arguments of a command of this package; if it has parts, ``options.what`` names the chosen one."""
    _ARGUMENTS.get(command, lambda _: None)(parser)


def add_log_arguments(parser: argparse.ArgumentParser, folder: str) -> None:
    """Add the options of a command that reads logger files and, without ``--output``, writes ``folder``."""
    parser.add_argument("logs", nargs="+", metavar="LOGS", help="files, folders or patterns, of any supported format")
    add_reading_arguments(parser)
    words = f"folder to write; default: {folder}"
    parser.add_argument("--output", "--into", dest="output", type=Path, default=Path(folder), help=words)
    parser.add_argument("--json", action="store_true", help="print the summary as JSON instead of lines")


def add_reading_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options that state how logger files are read, and of which cylinder they are."""
    words = (
        f"its YAML file with the same keys, or {EXAMPLE_CYLINDER}; moving_mass_kg is that of piston, rod and what "
        "moves rigidly with them, with a load cell or load pin only up to it; default: params.yaml of a project"
    )
    parser.add_argument("--cylinder", help=words)
    parser.add_argument("--channels", type=Path, help="mapping, as `ingest init` writes it; default: guessed")
    words = (
        "unit that the files do not state: pressure=bar, length=mm, time=ms, ..., or the rate of the rows: time=200Hz; "
        "may be repeated"
    )
    parser.add_argument("--unit", action="append", default=[], metavar="QUANTITY=UNIT", help=words)
    words = (
        "accuracy of pressure sensors and a load cell that state none, as the limit of their error, ± %% of full "
        "scale; 0.5 is typical; default: unknown"
    )
    parser.add_argument("--sensor-class", type=float, metavar="PERCENT", help=words)
    words = "what the cylinder carries, a weighed load [N] as 4218, 4218+-40 or, pulling, -1500; default: as mapped"
    parser.add_argument("--load", metavar="none|measured|position|NEWTONS", help=words)
    parser.add_argument("--dbc", type=Path, help="DBC file of the bus, for MDF files of CAN frames")
    parser.add_argument("--names", help="regular expression on a file's path, with the groups condition and session")


def _estimate(parser: argparse.ArgumentParser) -> None:
    add_log_arguments(parser, "friction")
    parser.add_argument(
        "--model", help="folder of a saved estimator, or models:/NAME@ALIAS; default: none, the off-line label"
    )
    words = "use a model that was trained for another cylinder, which is refused otherwise"
    parser.add_argument("--other-cylinder", action="store_true", help=words)
    words = f"number of processes; default: one per core for {FEW_FILES} logs or more, else one"
    parser.add_argument("--workers", type=int, metavar="N", help=words)
    words = "format of the results; csv: a file beside each Parquet file; default: parquet"
    parser.add_argument("--format", choices=("parquet", "csv"), default="parquet", help=words)


def _identify(parser: argparse.ArgumentParser) -> None:
    add_log_arguments(parser, "friction_models")
    words = "greatest number of generations of the global search; default: 50"
    parser.add_argument("--generations", type=int, default=50, help=words)


def _adapt(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("model", metavar="MODEL", help="folder of a saved hybrid, or models:/NAME@ALIAS")
    add_log_arguments(parser, "adapted")


def _inspect(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("path", type=Path, metavar="LOGS", help="a log file or a folder of log files")
    words = "further logs; or, by the rules of a project, overrides such as ingest=own cylinder=press"
    parser.add_argument("overrides", nargs="*", metavar="MORE", help=words)
    add_reading_arguments(parser)
    words = "page to write, a file that ends in .html; default: reports/inspection.html"
    parser.add_argument("--output", type=Path, default=Path("reports/inspection.html"), help=words)


def _export(parser: argparse.ArgumentParser) -> None:
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
            continue
        form.add_argument("--name", default="friction", help="prefix of every name, and the files' name")
        form.add_argument("--precision", choices=("double", "float"), default="double", help="of samples and estimates")
        words = "part to export; lstm: without the forest; base: only the filtered force balance"
        form.add_argument("--model", dest="part", choices=("whole", "lstm", "base"), default="whole", help=words)
        form.add_argument("--distil", type=int, metavar="NODES", help="first train a smaller LSTM to imitate it")
        form.add_argument("--data", type=Path, default=Path("data/processed"), help="recordings for --distil")


def _ingest(parser: argparse.ArgumentParser) -> None:
    parts = parser.add_subparsers(dest="what", required=True)
    init = parts.add_parser("init", help="write a first mapping", description="Write a first mapping.")
    init.add_argument("file", type=Path, help="a logger's file, in any format that ingest reads")
    init.add_argument("--dbc", type=Path, help="DBC file of the bus, for an MDF file of CAN frames")
    init.add_argument("--output", type=Path, help="file to write, such as conf/ingest/press.yaml; default: print it")


def _stage(parser: argparse.ArgumentParser) -> None:
    from cylinder_friction.run_record import STAGES  # only this command lists them

    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    stages = "".join(f"\n- {name + ':':<11}{_stage_purpose(name)}" for name in STAGES)
    parser.epilog = f"Stages, in the pipeline's order:\n{stages}"
    parser.add_argument("what", metavar="STAGE", choices=STAGES, help="one of the stages below")


def _stage_purpose(stage: str) -> str:
    """Read what a stage does from the first line of its module, which is not imported for it."""
    docstring = ast.get_docstring(ast.parse((_STAGES_FOLDER / f"{stage}.py").read_text(encoding="utf-8"))) or ""
    return docstring.splitlines()[0].partition(": ")[2].replace("``", "").rstrip(".")


def _serve(parser: argparse.ArgumentParser) -> None:
    words = "models:/NAME@champion, models:/NAME/VERSION or a model's folder; default: the champion"
    parser.add_argument("model", nargs="?", help=words)
    words = "name or address to listen on; default: %(default)s, for a proxy that brings logins and TLS"
    parser.add_argument("--host", default="127.0.0.1", help=words)
    parser.add_argument("--port", type=int, default=5001, help="port, 0 for a free one; default: %(default)s")
    parser.add_argument("--workers", type=int, default=1, help="number of processes; default: %(default)s")


def _ui(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--port", type=int, help="port on this machine; default: a free one")


def _promote(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("version", type=int, help="version number")
    parser.add_argument("model_name", nargs="?", help="name in the registry; default: that of params.yaml")


def _rollback(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("model_name", nargs="?", help="name in the registry; default: that of params.yaml")
    parser.add_argument("--to", metavar="VERSION", type=int, help="version number; default: the previous champion")


def _lineage(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("model", nargs="?", help="models:/NAME@champion or models:/NAME/VERSION; default: the champion")


def _init(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("folder", type=Path, help="folder to make")


def _params(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("overrides", nargs="*", help="for example experiment=smoke search.trials=5")


_ARGUMENTS: dict[str, Callable[[argparse.ArgumentParser], None]] = {
    "init": _init,
    "stage": _stage,
    "params": _params,
    "ingest": _ingest,
    "estimate": _estimate,
    "identify": _identify,
    "adapt": _adapt,
    "inspect": _inspect,
    "lineage": _lineage,
    "promote": _promote,
    "rollback": _rollback,
    "ui": _ui,
    "serve": _serve,
    "export": _export,
}
