"""Where the repository lies and which commit it is at, and the errors of tracking."""

import subprocess
from dataclasses import dataclass
from pathlib import Path


class TrackingError(RuntimeError):
    """The tracking store could not be reached, or what is to be logged is not what was recorded."""


class LineageError(TrackingError):
    """The way back from a model cannot be written down or followed; the message names what is missing."""


RESULT_SHAPING_PATHS = (":/src", "conf", "params.yaml", "dvc.yaml", ":/pyproject.toml")
"""What decides a result besides the data: the code, from the repository's root, and the configuration of a pipeline.

``dvc.lock`` is written by every run and does not describe the code."""

_DVC_TEMPORARY = (".dvc", "tmp", "exps")


@dataclass(frozen=True)
class Commit:
    """The commit a result was made at; ``dirty`` when code or configuration had changes that are not in it."""

    sha: str
    dirty: bool

    def tags(self) -> dict[str, str]:
        return {"git_commit": self.sha, "git_dirty": str(self.dirty).lower()}


def repository_root(start: Path) -> Path:
    """Return the absolute root of the repository that holds ``start``; ``start`` itself where there is none.

    An experiment that DVC runs in ``.dvc/tmp/exps`` belongs to the repository around it, not to the throw-away copy,
    and a pipeline in a DVC repository of its own, one folder below, to the repository above it.
    """
    start = start.resolve()
    for index in range(len(start.parts) - len(_DVC_TEMPORARY) + 1):
        if start.parts[index : index + len(_DVC_TEMPORARY)] == _DVC_TEMPORARY:
            return Path(*start.parts[:index])
    for folder in (start, *start.parents):
        if (folder / ".git").exists() or ((folder / ".dvc").is_dir() and not (folder.parent / ".dvc").is_dir()):
            return folder
    return start


def git(root: Path, *arguments: str) -> str | None:
    """Return the output of git, stripped; None where git fails, is absent or ``root`` is no repository."""
    try:
        done = subprocess.run(  # noqa: S603
            ["git", "-C", str(root), *arguments],  # noqa: S607
            capture_output=True, text=True, timeout=30, check=False,
        )  # fmt: skip
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.strip() if done.returncode == 0 else None


def commit_of(root: Path) -> Commit:
    """Return the commit that ``root`` is at; ``unknown`` and dirty where there is none."""
    sha = git(root, "rev-parse", "HEAD")
    if sha is None:
        return Commit("unknown", dirty=True)
    changes = git(root, "status", "--porcelain", "--", *RESULT_SHAPING_PATHS)
    return Commit(sha, dirty=changes != "")
