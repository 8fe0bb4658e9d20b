"""The command line: ``cylinder-friction COMMAND``, one module of this package per command."""

import argparse
import errno
import importlib
import os
import re
import sys
import traceback
import warnings
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeAlias

import shtab

from cylinder_friction.commands.arguments import COMMANDS, add_arguments
from cylinder_friction.commands.plugins import ELSEWHERE, load, not_installed, plugins
from cylinder_friction.extras import explained
from cylinder_friction.refusal import RefusalError

COMPLETION, SHELLS = "--print-completion", ("bash", "zsh", "tcsh")
COMPLETION_HELP = "print the completion script of a shell"
EXTRAS = {
    "serve": "serve",
    "ui": "serve",
    **dict.fromkeys(("stage", "params", "track", "lineage", "promote", "rollback"), "pipeline"),
}
"""Commands that need an extra, and the extra; the others need only the core."""
SERVERS = {"ui": "MLflow's UI", "serve": "MLflow's model server"}
"""Commands that are silent until a server is ready, and that server."""
LOOK = "check the path"
ADVICE = {
    **dict.fromkeys((errno.EROFS, errno.EACCES, errno.EPERM), "choose a place where you may read and write"),
    **dict.fromkeys((errno.ENOSPC, errno.EDQUOT), "make room, then run the same command again"),
}
"""Advice on errors of the operating system, by their numbers."""
REFUSALS = RefusalError, FileNotFoundError, FileExistsError
"""Errors whose message is all that the user of any command needs."""
INTERRUPTED = 130  # Exit status after Ctrl-C, as in shells
UNREAD = 141  # Exit status if the program that reads the output, such as head, has ended


Subparsers: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns 0, or 1 with a message if the user can do something about it."""
    return with_unread_output(lambda: _run(list(sys.argv[1:] if arguments is None else arguments)))


def with_unread_output(run: Callable[[], int]) -> int:
    """Run a command and return its status, or ``UNREAD`` if the program that reads its output has ended."""
    try:
        status = run()
    except (BrokenPipeError, SystemExit) as ended:  # of --help, too
        if not _is_unread("\n" if isinstance(ended, BrokenPipeError) else ""):
            raise
        return UNREAD
    return UNREAD if _is_unread() else status


def _is_unread(more: str = "") -> bool:
    """Check whether the program that reads the output has ended. If so, drop the rest of the output."""
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
    try:
        options = parser(None if COMPLETION in given else first).parse_args(_signed(given))
    except KeyboardInterrupt:
        return INTERRUPTED
    name = " ".join(["cylinder-friction", options.command, *([options.what] if "what" in options else [])])
    warnings.formatwarning = lambda message, *_, **__: f"{name}: note: {message}\n"  # without the line of code
    if options.command in SERVERS:
        print(f"{name}: starting {SERVERS[options.command]}, which can take a minute", file=sys.stderr, flush=True)
    work: Any = None
    try:
        with explained(EXTRAS.get(first, "")):
            work = options.work if not isinstance(options.work, str) else importlib.import_module(options.work)
            return int(work.run(options) or 0)
    except KeyboardInterrupt:
        kept = getattr(work, "kept", lambda _: "nothing is half-written; run the same command again")
        print(f"\n{name}: interrupted; {kept(options)}", file=sys.stderr)
        return INTERRUPTED
    except Exception as error:
        found = system_refusal(error) or machine_code_refusal(error)
        expected = (*REFUSALS, *getattr(work, "EXPECTED", ()))
        if isinstance(error, BrokenPipeError) or not (found or isinstance(error, expected)):
            raise
        print(f"{name}: {found or error}", file=sys.stderr)
        return 1


def _signed(given: Sequence[str]) -> list[str]:
    """Join ``--load`` and a negative number with its uncertainty, which ``argparse`` takes for an option."""
    words = list(given)
    for place in reversed(range(len(words) - 1)):
        if words[place] == "--load" and re.match(r"-\d", words[place + 1]):
            words[place : place + 2] = [f"--load={words[place + 1]}"]
    return words


def system_refusal(error: Exception) -> str:
    """Explain in a sentence what the operating system does not allow; empty for other errors."""
    if not isinstance(error, OSError) or not error.strerror or not (error.filename or error.errno in ADVICE):
        return ""
    path = Path(os.fsdecode(error.filename)) if isinstance(error.filename, str | bytes) else None
    if path is not None and path.name.startswith(".") and ".draft" in path.name:
        path = path.resolve().parent  # a draft is written beside the file that it becomes
    place = "" if path is None else f"{path}: "
    return f"{place}{error.strerror[0].lower()}{error.strerror[1:]}; {ADVICE.get(error.errno or 0, LOOK)}"


def machine_code_refusal(error: Exception) -> str:
    """Explain that machine code kept by another version names what this one does not have; empty for other errors."""
    places = [frame.f_globals.get("__name__") for frame, _ in traceback.walk_tb(error.__traceback__)]
    if not isinstance(error, AttributeError | ImportError) or places[-1:] != ["numba.core.caching"]:
        return ""
    return (
        f"machine code that another version kept cannot be read ({error}); delete the files *.nbi in "
        f"{Path(__file__).parents[1]}, in Numba's folder in the user's cache and in NUMBA_CACHE_DIR, if it is set, "
        "then run the same command again"
    )


def parser(command: str | None = None) -> argparse.ArgumentParser:
    """Build the parser of all commands, or one in which only ``command`` has its arguments.

    If ``command`` is one of this package, no plugin is imported. An empty string lists all commands without arguments.
    ``options.work`` names the module that does the work; it is imported after parsing. It has ``run(options)``, which
    returns the exit status or None, and if needed ``EXPECTED``, errors whose message is enough, and ``kept(options)``,
    what is left after Ctrl-C. Commands of other packages: ``plugins.GROUP``.
    """
    result = argparse.ArgumentParser(
        prog="cylinder-friction",
        description="Friction inside a hydraulic cylinder: from sensor logs to a real-time estimator.",
    )
    result.add_argument("--version", action=_Version, nargs=0, help="show program's version number and exit")
    commands = result.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, words in COMMANDS.items():
        added = _add_command(commands, name, words, f"cylinder_friction.commands.{name}")
        if command in (None, name):
            add_arguments(added, name)
    if command not in COMMANDS:
        for name, entry in plugins().items():
            if name not in COMMANDS:
                module = load(entry)
                module.add_arguments(_add_command(commands, name, module.HELP, getattr(module, "WORK", module)))
    if command is None:
        _add_completion(result)
    else:
        result.add_argument(COMPLETION, choices=SHELLS, help=COMPLETION_HELP)
    return result


def _add_command(commands: Subparsers, name: str, words: str, work: Any) -> argparse.ArgumentParser:
    """Add a command to the parser: what it does in words, and the module, or its name, that does the work."""
    command = commands.add_parser(name, help=words, description=f"{words[0].upper()}{words[1:]}.")
    command.set_defaults(work=work)
    return command


class _Version(argparse.Action):
    """Prints the version and ends."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        print(f"cylinder-friction {version('cylinder-friction')}")
        parser.exit()


def _add_completion(top: argparse.ArgumentParser) -> None:
    shtab.add_argument_to(top, [COMPLETION], help=COMPLETION_HELP)
    queue = [top]
    while queue:
        for action in queue.pop()._actions:
            if isinstance(action, argparse._SubParsersAction):
                queue += action.choices.values()
            elif action.type is Path:
                action.complete = shtab.FILE  # type: ignore[attr-defined]


if __name__ == "__main__":
    sys.exit(main())
