"""A folder of results that a later run may replace: a run removes only the files that an earlier run listed as its own.

The file that makes the folder ours, the *marker*, states what wrote it and lists every file of it::

    {"written_by": "cylinder-friction estimate", "files": ["a.parquet", "friction.html", "summary.json"], ...}
"""

import json
import os
import shutil
import uuid
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from cylinder_friction.recordings.files import DRAFTS, read_json, write_json
from cylinder_friction.recordings.locks import locked

WHOLE, PLAN = "whole", ".plan.json"
"""Name of a draft whose results only have to be moved, and of the file in it that states where."""


@dataclass(frozen=True)
class ResultFolder:
    """A folder that one kind of run writes.

    Args:
        folder: Where the results go.
        marker: Name of the JSON file that lists the results.
        written_by: What writes the folder; an earlier result of another kind is not replaced.
        inputs: Files and folders that the run reads.
    """

    folder: Path
    marker: str
    written_by: str
    inputs: tuple[Path, ...] = ()

    def check(self) -> None:
        """Refuse a folder that this run must not write, before any work is done.

        Raises:
            FileExistsError: The folder is, holds or lies in an input, or holds something that no earlier run listed.
        """
        self._refuse_inputs()
        self._listed_before()

    @contextmanager
    def written(self) -> Iterator[Path]:
        """Yield an empty folder for the results, marker included; they are moved into place if the block succeeds.

        Files of the earlier run are replaced or removed, but for those that the new marker lists as ``kept``. Files
        that no earlier run listed stay where they are. Until all files are in place, the marker lists old and new files
        together and is marked ``unfinished``; what a killed run had not yet moved, the next one moves first. A block
        that leaves no marker in its folder changes nothing.

        Raises:
            FileExistsError: As ``check``; or another run is writing the folder; or a result would overwrite a file
                that no earlier run listed. Nothing has been changed then.
        """
        self.check()
        drafts = self.folder.with_name(f".{self.folder.name}.draft")
        lock = drafts / "lock"
        with locked(lock, wait=False) as held:
            if not held:
                raise FileExistsError(
                    f"{self.folder}: another run is writing this folder; wait for it, or name another"
                )
            try:
                _remove_drafts(drafts)
                self._finish(drafts / WHOLE)
                draft = drafts / uuid.uuid4().hex
                draft.mkdir()
                yield draft
                if (draft / self.marker).exists():
                    self._settle(draft)
                    draft.rename(drafts / WHOLE)  # from here on the results are these
                    self._finish(drafts / WHOLE)
            finally:
                _remove_drafts(drafts)
                lock.unlink()
                with suppress(OSError):  # the next run has begun
                    drafts.rmdir()

    def _settle(self, draft: Path) -> None:
        """Write into a draft what becomes of every file, old and new."""
        for unfinished in draft.rglob(DRAFTS):  # of a worker that was killed while it wrote
            unfinished.unlink()
        new = sorted(path.relative_to(draft).as_posix() for path in draft.rglob("*") if path.is_file())
        content, old = read_json(draft / self.marker), self._listed_before()
        kept = set(content.pop("kept", ())) & set(old)
        for name in set(new) - set(old):
            if os.path.lexists(self.folder / name):
                raise FileExistsError(
                    f"{self.folder / name}: is in the place of a result, but no earlier run wrote it; move it away, or "
                    "name a new folder"
                )
        if wrong := _outside(self.folder, new):
            raise FileExistsError(f"{self.folder}: {wrong[0]!r} cannot be the name of a result; rename its input")
        content |= {"written_by": self.written_by, "files": sorted({*new, *kept})}
        write_json(draft / PLAN, {"new": new, "old": old, "content": content})

    def _finish(self, draft: Path) -> None:
        """Move the files of a whole draft into place; those of which a killed run has moved some, too."""
        if not draft.is_dir():
            return
        plan = read_json(draft / PLAN)
        names = [*plan["old"], *plan["new"], *plan["content"]["files"]]
        if plan["content"]["written_by"] != self.written_by or _outside(self.folder, names):
            raise FileExistsError(
                f"{draft}: is no unfinished result of `{self.written_by}`; remove it, or find its owner"
            )
        both = sorted({*plan["old"], *plan["new"]})
        self.folder.mkdir(parents=True, exist_ok=True)
        unfinished = {"written_by": self.written_by, "unfinished": True}
        write_json(self.folder / self.marker, unfinished | {"files": sorted({*both, *plan["content"]["files"]})})
        for name in plan["new"]:
            if name != self.marker and (draft / name).exists():
                (self.folder / name).parent.mkdir(parents=True, exist_ok=True)
                (draft / name).replace(self.folder / name)
        for name in set(plan["old"]) - set(plan["content"]["files"]):
            (self.folder / name).unlink(missing_ok=True)
        for folder in sorted({(self.folder / name).parent for name in both}, reverse=True):
            _remove_if_empty(folder)
        write_json(self.folder / self.marker, plan["content"])
        # A kill while files are removed must not leave a whole draft without its plan.
        shutil.rmtree(draft.rename(draft.with_name(uuid.uuid4().hex)))

    def _refuse_inputs(self) -> None:
        output = self.folder.resolve()
        for each in self.inputs:
            path = each.resolve()
            if path == output or path.is_relative_to(output):
                problem = f"is, or holds, the input {each}"
            elif output.is_relative_to(path):
                problem = f"lies in the input {each}"
            else:
                continue
            raise FileExistsError(f"{self.folder}: {problem}; name a folder outside of what is read")

    def _listed_before(self) -> list[str]:
        """Return the files of the earlier run; none if the folder is new or empty."""
        if not self.folder.exists() or (self.folder.is_dir() and not any(self.folder.iterdir())):
            return []
        marker = self.folder / self.marker
        refusal = f"{self.folder}: exists already, and "
        if not marker.is_file():
            raise FileExistsError(f"{refusal}holds no {self.marker} of an earlier run; name a new folder")
        try:
            content: Any = json.loads(marker.read_text(encoding="utf-8"))
        except ValueError:
            content = None
        files = content.get("files") if isinstance(content, dict) else None
        if not isinstance(files, list) or content.get("written_by") != self.written_by:
            raise FileExistsError(
                f"{refusal}its {self.marker} does not list the files of an earlier `{self.written_by}`; "
                "name a new folder"
            )
        wrong = _outside(self.folder, files)
        if wrong:
            raise FileExistsError(
                f"{refusal}its {self.marker} lists {wrong[0]!r}, which is no file inside it; name a new folder"
            )
        return files


def _outside(folder: Path, names: Iterable[Any]) -> list[Any]:
    """Return the listed names that are no plain relative path to a file, with no link on the way out of the folder."""
    root, inside = folder.resolve(), set[PurePosixPath]()  # folders on the way that were looked at
    wrong = []
    for name in names:
        path = PurePosixPath(name) if isinstance(name, str) and not {"\0", "\\"} & set(name) else PurePosixPath("/")
        if path.is_absolute() or not path.parts or ".." in path.parts or os.path.isdir(folder / path):  # noqa: PTH112
            wrong.append(name)
        elif path.parent not in inside:
            if (folder / path.parent).resolve().is_relative_to(root):
                inside.add(path.parent)
            else:
                wrong.append(name)
    return wrong


def _remove_drafts(drafts: Path) -> None:
    """Remove what killed runs left behind; only folders that bear the name of a draft."""
    for path in drafts.iterdir():
        if path.is_dir() and len(path.name) == 32 and set(path.name) <= set("0123456789abcdef"):
            shutil.rmtree(path, ignore_errors=True)


def _remove_if_empty(folder: Path) -> None:
    if folder.is_dir() and not any(folder.iterdir()):
        folder.rmdir()


def existing(paths: Iterable[str | Path | None]) -> tuple[Path, ...]:
    """Return those of some paths that exist; None and patterns are left out."""
    return tuple(Path(path) for path in paths if path is not None and os.path.lexists(path))
