"""A folder of results that a later run may replace. A run removes only files that an earlier run listed as its own.

The *marker* file shows that the folder is ours: it states what wrote the folder and lists all its files::

    {"written_by": "cylinder-friction identify", "files": ["friction_models.html", "friction_models.json"], ...}
"""

import os
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cylinder_friction.files.whole_files import DRAFTS, locked, read_json, write_json


@dataclass(frozen=True)
class ResultFolder:
    """A folder that one kind of run writes.

    Args:
        folder: Where the results go.
        marker: Name of the JSON file that lists the results.
        written_by: The command that writes the folder; results of another command are not replaced.
        inputs: Files and folders that the run reads.
    """

    folder: Path
    marker: str
    written_by: str
    inputs: tuple[Path, ...] = ()

    def check(self) -> None:
        """Refuse a folder that this run must not write, before any work is done.

        Raises:
            FileExistsError: The folder overlaps with an input, or contains files that no earlier run listed.
        """
        output = self.folder.resolve()
        for each in self.inputs:
            path = each.resolve()
            inside = path.is_relative_to(output)
            if inside or output.is_relative_to(path):
                problem = f"is, or holds, the input {each}" if inside else f"lies in the input {each}"
                raise FileExistsError(f"{self.folder}: {problem}; name a folder outside of what is read")
        self.listed()

    @contextmanager
    def scratch(self) -> Iterator[Path]:
        """Yield an empty temporary folder beside this one, and keep other runs out until it is closed.

        Raises:
            FileExistsError: As ``check``, or another run is writing the folder.
        """
        self.check()
        beside = self.folder.with_name(f".{self.folder.name}.draft")
        lock, scratch = beside / "lock", beside / "scratch"
        with locked(lock, wait=False) as held:
            if not held:
                raise FileExistsError(
                    f"{self.folder}: another run is writing this folder; wait for it, or name another"
                )
            try:
                shutil.rmtree(scratch, ignore_errors=True)  # left by a killed run, like the drafts
                for draft in self.folder.rglob(DRAFTS):
                    draft.unlink()
                scratch.mkdir()
                yield scratch
            finally:
                shutil.rmtree(scratch, ignore_errors=True)
                lock.unlink()
                with suppress(OSError):  # the next run has begun
                    beside.rmdir()

    @contextmanager
    def written(self) -> Iterator[Path]:
        """Yield an empty folder for the results and the marker; they are moved into place if the block succeeds.

        Files of the earlier run are replaced or removed, except those that the new marker lists as ``kept``. Files
        that no earlier run listed stay unchanged. If the block writes no marker, nothing changes. If the run is killed
        while files are moved, the marker lists the old and the new files, and the next run replaces them.

        Raises:
            FileExistsError: As ``scratch``, or a result would overwrite a file that no earlier run listed. The folder
                is then unchanged.
        """
        with self.scratch() as draft:
            yield draft
            if not (draft / self.marker).exists():
                return
            for unfinished in draft.rglob(DRAFTS):  # left by a worker that was killed while writing
                unfinished.unlink()
            new = {path.relative_to(draft).as_posix() for path in draft.rglob("*") if path.is_file()}
            content, old = read_json(draft / self.marker), set(self.listed())
            kept = old & set(content.pop("kept", ()))
            for name in new - old:
                refuse_foreign(self.folder / name)
            self.claim(old | new)
            for name in new - {self.marker}:
                (self.folder / name).parent.mkdir(parents=True, exist_ok=True)
                (draft / name).replace(self.folder / name)
            self.remove(old - new - kept)
            self.claim(new | kept, content)

    def claim(self, files: Iterable[str] = (), content: dict[str, Any] | None = None) -> None:
        """Write the marker, which claims these files."""
        own = {"written_by": self.written_by, "files": sorted({*files, self.marker})}
        write_json(self.folder / self.marker, {**(content or {}), **own})

    def remove(self, files: Iterable[str]) -> None:
        """Remove files of this folder, and folders that become empty."""
        for name in files:
            (self.folder / name).unlink(missing_ok=True)
            parent = (self.folder / name).parent
            if parent != self.folder and parent.is_dir() and not any(parent.iterdir()):
                parent.rmdir()

    def listed(self) -> list[str]:
        """List the files of the earlier run; none if the folder is new or empty."""
        if not self.folder.exists() or (self.folder.is_dir() and not any(self.folder.iterdir())):
            return []
        marker = self.folder / self.marker
        refusal = f"{self.folder}: exists already, and "
        if not marker.is_file():
            raise FileExistsError(f"{refusal}holds no {self.marker} of an earlier run; name a new folder")
        content: Any = None
        with suppress(ValueError):
            content = read_json(marker)
        files = content.get("files") if isinstance(content, dict) else None
        if not isinstance(files, list) or content.get("written_by") != self.written_by:
            raise FileExistsError(
                f"{refusal}its {self.marker} does not list the files of an earlier `{self.written_by}`; "
                "name a new folder"
            )
        return files


def refuse_foreign(path: Path) -> None:
    """Refuse to write a result over a file that no earlier run wrote (``FileExistsError``)."""
    if os.path.lexists(path):
        raise FileExistsError(
            f"{path}: is in the place of a result, but no earlier run wrote it; move it away, or name a new folder"
        )


def existing(paths: Iterable[str | Path | None]) -> tuple[Path, ...]:
    """Select the paths that exist; None and patterns are left out."""
    return tuple(Path(path) for path in paths if path is not None and os.path.lexists(path))
