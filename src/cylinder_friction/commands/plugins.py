"""Commands of other packages, which these register as entry points."""

from __future__ import annotations

from importlib.metadata import EntryPoint, entry_points

GROUP = "cylinder_friction.commands"
"""In ``pyproject.toml``: ``[project.entry-points."cylinder_friction.commands"]`` with ``NAME = "MODULE"``.

The module has ``HELP``, what the command does in a few words, and else what a module of this package has (see
``cli.parser``). It imports little: ``--help`` imports the modules of all commands.
"""
ELSEWHERE = {
    "live": "cylinder-friction-live",
    "monitor": "cylinder-friction-monitoring",
}
"""Known commands that another package brings: the command's name to that of the package."""


def plugins() -> dict[str, EntryPoint]:
    """Find the commands that installed packages register, by name, sorted."""
    return {each.name: each for each in sorted(entry_points(group=GROUP), key=lambda each: each.name)}


def not_installed(command: str) -> str:
    """Return the sentence on a known command whose package is not installed."""
    package = ELSEWHERE[command]
    folder = package.removeprefix("cylinder-friction-")
    return (
        f"this command is part of {package}, which is not installed; pip install {package}, or `make {command}` in a "
        f"checkout, which installs its folder {folder}/"
    )
