"""Commands of other packages, which these register as entry points."""

from __future__ import annotations

import argparse
from importlib.metadata import EntryPoint, entry_points
from types import SimpleNamespace
from typing import Any

GROUP = "cylinder_friction.commands"
"""In ``pyproject.toml``: ``[project.entry-points."cylinder_friction.commands"]`` with ``NAME = "MODULE"``.

The module has ``HELP``, what the command does in a few words, ``add_arguments(parser)``, and ``WORK``, the name of the
module that does the work (see ``cli.parser``); without ``WORK`` the module does it itself. It should import little, for
``--help`` imports it.
"""
ELSEWHERE = {
    "live": "cylinder-friction-live",
    "monitor": "cylinder-friction-monitoring",
}
"""Known commands that another package brings: the command's name to that of the package."""


class PluginError(RuntimeError):
    """A package brings a command that cannot be imported."""


def plugins() -> dict[str, EntryPoint]:
    """Find the commands that installed packages register, by name, sorted."""
    return {each.name: each for each in sorted(entry_points(group=GROUP), key=lambda each: each.name)}


def load(entry: EntryPoint) -> Any:
    """Import the module of a command. If that fails, the command is listed with the reason, and refuses to run."""
    try:
        return entry.load()
    except Exception as error:
        package = entry.dist.name if entry.dist else entry.value
        reason = (
            f"this command is part of {package}, which cannot be imported ({type(error).__name__}: {error}); install "
            f"{package} again, or remove it: pip uninstall {package}"
        )

    def add_arguments(parser: argparse.ArgumentParser) -> None:
        parser.add_argument("arguments", nargs=argparse.REMAINDER)

    def run(_options: argparse.Namespace) -> int:
        raise PluginError(reason)

    words = reason.replace("%", "%%")
    return SimpleNamespace(HELP=words, add_arguments=add_arguments, run=run, EXPECTED=(PluginError,))


def not_installed(command: str) -> str:
    """State which package brings a known command that is not installed, and how to install it."""
    package = ELSEWHERE[command]
    folder = package.removeprefix("cylinder-friction-")
    return (
        f"this command is part of {package}, which is not installed; pip install {package}, or `make {command}` in a "
        f"checkout, which installs its folder {folder}/"
    )
