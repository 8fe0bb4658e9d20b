"""The command line: ``cylinder-friction COMMAND``, one module of this package per command."""

import argparse
import errno
import importlib
import os
import sys
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeAlias

from cylinder_friction.commands.plugins import ELSEWHERE, load, not_installed, plugins
from cylinder_friction.extras import MissingExtraError, explained

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
COMPLETION, SHELLS = "--print-completion", ("bash", "zsh", "tcsh")
COMPLETION_HELP = "print the completion script of a shell"
EXTRAS = {
    "serve": "serve",
    "ui": "serve",
    **dict.fromkeys(("stage", "params", "track", "lineage", "promote", "rollback"), "pipeline"),
}
"""Command to the extra that brings all it needs; the others need the core."""
LOOK = "check the path"
ADVICE = {
    **dict.fromkeys((errno.EROFS, errno.EACCES, errno.EPERM), "choose a place where you may read and write"),
    **dict.fromkeys((errno.ENOSPC, errno.EDQUOT), "make room, then run the same command again"),
}
"""What to do, by the operating system's number of an error."""
INTERRUPTED = 130  # The exit status of what Ctrl-C ended, as shells have it
UNREAD = 141  # That of what writes to a program that has ended, such as head


Subparsers: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns 0, or 1 with a message where the user can do something about it."""
    return until_unread(lambda: _run(list(sys.argv[1:] if arguments is None else arguments)))


def until_unread(run: Callable[[], int]) -> int:
    """Return the status of what runs, or ``UNREAD`` where the program that reads its output has ended."""
    try:
        status = run()
    except (BrokenPipeError, SystemExit) as ended:  # of --help, too
        if not _is_unread("\n" if isinstance(ended, BrokenPipeError) else ""):
            raise
        return UNREAD
    return UNREAD if _is_unread() else status


def _is_unread(more: str = "") -> bool:
    """Return whether the program that read the output has ended; what is left of the output is then dropped."""
    try:
        print(end=more, flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return True
    return False


def _run(given: Sequence[str]) -> int:
    first = given[0] if given else ""
    if first in ELSEWHERE and first not in COMMANDS and first not in plugins():
        print(f"cylinder-friction {first}: {not_installed(first)}", file=sys.stderr)
        return 1
    extra = EXTRAS.get(first, "")
    try:
        with explained(extra):
            options = parser(None if COMPLETION in given else first).parse_args(given)
    except KeyboardInterrupt:
        return INTERRUPTED
    except MissingExtraError as error:
        print(f"cylinder-friction {given[0]}: {error}", file=sys.stderr)
        return 1
    name = " ".join(["cylinder-friction", options.command, *([options.what] if "what" in options else [])])
    warnings.formatwarning = lambda message, *_, **__: f"{name}: note: {message}\n"  # the line of code helps nobody
    try:
        with explained(extra):
            return int(options.run(options) or 0)
    except KeyboardInterrupt:
        print(f"\n{name}: interrupted; {options.kept(options)}", file=sys.stderr)
        return INTERRUPTED
    except Exception as error:
        found = of_the_system(error)
        if isinstance(error, BrokenPipeError) or not (found or isinstance(error, (*refusals(), *options.expected))):
            raise
        print(f"{name}: {found or error}", file=sys.stderr)
        return 1


def of_the_system(error: Exception) -> str:
    """Return a sentence for what the operating system does not allow; empty for other errors."""
    if not isinstance(error, OSError) or not error.strerror or not (error.filename or error.errno in ADVICE):
        return ""
    path = Path(os.fsdecode(error.filename)) if isinstance(error.filename, str | bytes) else None
    if path is not None and path.name.startswith(".") and ".draft" in path.name:
        path = path.resolve().parent  # where the file of that name was to be written
    place = "" if path is None else f"{path}: "
    return f"{place}{error.strerror[0].lower()}{error.strerror[1:]}; {ADVICE.get(error.errno or 0, LOOK)}"


def parser(command: str | None = None) -> argparse.ArgumentParser:
    """Return the parser of all commands, or one in which only ``command`` is complete.

    The other commands are listed, but their modules are not imported. An empty string completes none.

    A command's module gives ``run(options)``, which returns the exit status or None; and, where needed,
    ``add_arguments(parser)``, ``EXPECTED``, errors whose message is enough, and ``kept(options)``, what is left after
    Ctrl-C. Where a command has parts, their name is ``options.what``. Commands of other packages: ``plugins.GROUP``.
    """
    result = argparse.ArgumentParser(
        prog="cylinder-friction",
        description="Friction inside a hydraulic cylinder: from sensor logs to a real-time estimator.",
    )
    result.add_argument("--version", action=_Version, nargs=0, help="show program's version number and exit")
    commands = result.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, words in COMMANDS.items():
        module = f"cylinder_friction.commands.{name}" if command in (None, name) else ""
        _add(commands, name, words, importlib.import_module(module) if module else None)
    if command not in COMMANDS:
        for name, entry in plugins().items():
            if name not in COMMANDS:
                module = load(entry)
                _add(commands, name, module.HELP, module)
    if command is None:
        _add_completion(result)
    else:
        result.add_argument(COMPLETION, choices=SHELLS, help=COMPLETION_HELP)
    return result


def _add(commands: Subparsers, name: str, words: str, module: Any) -> None:
    """Add a command to the parser, with its arguments if its module is given."""
    command = commands.add_parser(name, help=words, description=f"{words[0].upper()}{words[1:]}.")
    if module is not None:
        getattr(module, "add_arguments", lambda _: None)(command)
        command.set_defaults(
            run=module.run,
            expected=getattr(module, "EXPECTED", ()),
            kept=getattr(module, "kept", lambda _: "nothing is half-written; run the same command again"),
        )


class _Version(argparse.Action):
    """Prints the version and ends; it is looked up only then."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from importlib.metadata import version

        print(f"cylinder-friction {version('cylinder-friction')}")
        parser.exit()


def _add_completion(top: argparse.ArgumentParser) -> None:
    import shtab

    shtab.add_argument_to(top, [COMPLETION], help=COMPLETION_HELP)
    queue = [top]
    while queue:
        for action in queue.pop()._actions:
            if isinstance(action, argparse._SubParsersAction):
                queue += action.choices.values()
            elif action.type is Path:
                action.complete = shtab.FILE  # type: ignore[attr-defined]


def refusals() -> tuple[type[Exception], ...]:
    """Return the errors whose message is all that the user of any command needs."""
    from cylinder_friction.execution.workers import WorkersError
    from cylinder_friction.params.file import ParamsError
    from cylinder_friction.recordings.recording import RecordingError
    from cylinder_friction.tracking.repository import TrackingError

    refused = ParamsError, RecordingError, TrackingError, WorkersError, MissingExtraError
    return *refused, FileNotFoundError, FileExistsError


if __name__ == "__main__":
    sys.exit(main())
