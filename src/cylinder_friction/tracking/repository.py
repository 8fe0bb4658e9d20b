"""The repository's root and commit, and the error of tracking."""

import subprocess
from pathlib import Path

from cylinder_friction.refusal import RefusalError


class TrackingError(RefusalError, RuntimeError):
    """The tracking store cannot be reached, or has no such model; or a file to be logged is missing."""


CODE_FILE = "code.yaml"
"""File with the hash of each stage's code. A project that uses the installed package keeps it in Git."""
SOURCES = ("src", ":/src", "conf", "dvc.yaml", ":/pyproject.toml")
"""Paths whose changes make a commit dirty. Results and ``params.yaml`` do not: records and ``dvc.lock`` state them."""
_DVC_TEMPORARY = (".dvc", "tmp", "exps")


def repository_root(start: Path) -> Path:
    """Find the absolute root of the repository that contains ``start``; without a repository, return ``start``.

    An experiment that DVC runs in ``.dvc/tmp/exps`` belongs to the surrounding repository, not to the temporary copy.
    A DVC repository directly inside another DVC repository belongs to the outer one.
    """
    start = start.resolve()
    for index in range(len(start.parts) - len(_DVC_TEMPORARY) + 1):
        if start.parts[index : index + len(_DVC_TEMPORARY)] == _DVC_TEMPORARY:
            return Path(*start.parts[:index])
    for folder in (start, *start.parents):
        if (folder / ".git").exists() or ((folder / ".dvc").is_dir() and not (folder.parent / ".dvc").is_dir()):
            return folder
    return start


def asked_git(root: Path, *arguments: str) -> tuple[str | None, str]:
    """Run git and return its stripped output. If git refuses, return None and the reason."""
    try:
        done = subprocess.run(  # noqa: S603
            ["git", "-C", str(root), *arguments],  # noqa: S607
            capture_output=True, text=True, timeout=30, check=False,
        )  # fmt: skip
    except (OSError, subprocess.TimeoutExpired) as error:
        return None, f"git cannot be run ({error})"
    return (done.stdout.strip(), "") if done.returncode == 0 else (None, " ".join(done.stderr.split()))


def commit_of(root: Path) -> dict[str, str]:
    """State a repository's commit as tags: ``git_commit``, ``git_dirty`` and, without a commit, ``git_problem``."""
    sha, problem = asked_git(root, "rev-parse", "--verify", "HEAD")
    if sha is None:
        return {"git_commit": "unknown", "git_dirty": "true", "git_problem": problem}
    changes, _ = asked_git(root, "status", "--porcelain", "--", *SOURCES)
    return {"git_commit": sha, "git_dirty": str(changes != "").lower()}
