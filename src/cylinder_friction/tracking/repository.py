"""Where the repository lies and which commit it is at, and the errors of tracking."""

import io
import re
import subprocess
import tarfile
import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import yaml

from cylinder_friction.import_graph import SOURCE, code_key


class TrackingError(RuntimeError):
    """The tracking store could not be reached, or what is to be logged is not what was recorded."""


class LineageError(TrackingError):
    """The way back from a model cannot be written down or followed; the message names what is missing."""


CODE_FILE = "code.yaml"
"""The hash of each stage's code. Git holds it in a project on the installed package, which has no source of its own."""
RESULT_SHAPING_PATHS = ("src", ":/src", "conf", "params.yaml", "dvc.yaml", CODE_FILE, ":/pyproject.toml")
"""What decides a result besides the data: a pipeline's code and configuration, and the code at the repository's root.

``dvc.lock`` is written by every run and does not describe the code."""

_COMMITS_SEARCHED = 50
_DVC_TEMPORARY = (".dvc", "tmp", "exps")


@dataclass(frozen=True)
class Commit:
    """The commit a result was made at; ``dirty`` when code or configuration had changes that are not in it."""

    sha: str
    dirty: bool


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


def commit_of(root: Path, stage: str = "", code: str = "") -> Commit:
    """Return the commit that has the code a stage ran with: the present one, or the newest other one that has it.

    Without ``code``, the hash of a stage's code, it is the commit that ``root`` is at. It is ``unknown`` and dirty
    where there is none.
    """
    sha = git(root, "rev-parse", "HEAD")
    if sha is None:
        return Commit("unknown", dirty=True)
    changes = git(root, "status", "--porcelain", "--", *RESULT_SHAPING_PATHS)
    if not code or code == _stage_code(stage, SOURCE) or code_at(root, sha, stage) == code:
        return Commit(sha, dirty=changes != "")
    for other in (
        git(root, "log", "--all", f"--max-count={_COMMITS_SEARCHED}", "--format=%H", "--", "src", CODE_FILE) or ""
    ).split():
        if code_at(root, other, stage) == code:
            return Commit(other, dirty=False)
    return Commit("unknown", dirty=True)


@cache
def code_at(root: Path, sha: str, stage: str) -> str | None:
    """Return the hash of a stage's code in a commit, by its sources or its ``code.yaml``; None where it has neither."""
    if not re.fullmatch("[0-9a-f]{4,64}", sha):
        return None  # a model from elsewhere may state an option of git's in its place
    command = ["git", "-C", str(root), "archive", "--format=tar", sha, "src"]
    done = subprocess.run(command, capture_output=True, timeout=60, check=False)  # noqa: S603
    if done.returncode != 0:
        codes: dict[str, str] = yaml.safe_load(git(root, "show", f"{sha}:./{CODE_FILE}") or "") or {}
        return str(codes[stage]).partition(" ")[0] if stage in codes else None  # own estimators follow
    with tempfile.TemporaryDirectory() as folder, tarfile.open(fileobj=io.BytesIO(done.stdout)) as archive:
        archive.extractall(folder, filter="data")
        return _stage_code(stage, Path(folder) / "src")


def _stage_code(stage: str, source: Path) -> str | None:
    try:
        return code_key(f"cylinder_friction.stages.{stage}", packages={"cylinder_friction": source})
    except ModuleNotFoundError:
        return None
