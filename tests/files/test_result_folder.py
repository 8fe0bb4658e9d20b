"""A result folder: replaced where an earlier run listed it, refused where not, and nobody's files are removed."""

import json
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pytest

from cylinder_friction.files.result_folder import ResultFolder

MARKER, COMMAND = "summary.json", "friction-tool run"


def result_folder(folder: Path, *inputs: Path) -> ResultFolder:
    return ResultFolder(folder, MARKER, COMMAND, inputs)


def write(folder: Path, *names: str, inputs: tuple[Path, ...] = ()) -> None:
    with result_folder(folder, *inputs).written() as draft:
        for name in names:
            (draft / name).parent.mkdir(exist_ok=True)
            (draft / name).write_text("result", encoding="utf-8")
        (draft / MARKER).write_text('{"of": "a run"}', encoding="utf-8")


def names(folder: Path) -> list[str]:
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if not path.is_dir())


def test_a_second_run_replaces_what_the_first_listed_and_nothing_else(tmp_path: Path) -> None:
    out = tmp_path / "out"
    write(out, "a", "parts/b")
    (out / "notes").write_text("mine", encoding="utf-8")
    write(out, "c")
    assert names(out) == ["c", "notes", MARKER]
    assert not (out / "parts").exists()
    assert json.loads((out / MARKER).read_text()) == {"of": "a run", "written_by": COMMAND, "files": ["c", MARKER]}
    assert names(tmp_path) == ["out/c", "out/notes", f"out/{MARKER}"]


def test_a_result_never_overwrites_a_file_that_no_run_wrote(tmp_path: Path) -> None:
    out = tmp_path / "out"
    write(out, "a")
    (out / "b").write_text("mine", encoding="utf-8")
    with pytest.raises(FileExistsError, match=r"b: is in the place of a result, but no earlier run wrote it"):
        write(out, "b", "c")
    assert names(out) == ["a", "b", MARKER]
    assert (out / "b").read_text() == "mine"


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ([], "does not list the files of an earlier `friction-tool run`"),
        ({"written_by": COMMAND}, "does not list the files"),
        ({"written_by": "another tool", "files": ["a"]}, "does not list the files"),
    ],
)
def test_a_marker_that_is_not_ours_is_refused(tmp_path: Path, content: Any, expected: str) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / MARKER).write_text(json.dumps(content), encoding="utf-8")
    before = names(tmp_path)
    with pytest.raises(FileExistsError, match=expected):
        write(out, "b")
    assert names(tmp_path) == before


@pytest.mark.parametrize("folder", ["logs", ".", "logs/out", "alias"])
def test_a_folder_that_is_read_is_not_written(tmp_path: Path, folder: str) -> None:
    (tmp_path / "logs").mkdir()
    (tmp_path / "alias").symlink_to(tmp_path / "logs")
    with pytest.raises(FileExistsError, match=r"the input .*; name a folder outside of what is read"):
        write(tmp_path / folder, "a", inputs=(tmp_path / "logs",))
    assert names(tmp_path) == []


def test_a_run_that_fails_changes_nothing(tmp_path: Path) -> None:
    out = tmp_path / "out"
    write(out, "a", "b")
    with pytest.raises(OSError, match="disk full"), result_folder(out).written() as draft:
        raise OSError(f"disk full: {draft}")
    assert names(tmp_path) == ["out/a", "out/b", f"out/{MARKER}"]


def test_two_runs_at_once_one_is_refused(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with result_folder(out).written() as draft:
        with pytest.raises(FileExistsError, match=r"out: another run is writing this folder; wait for it"):
            write(out, "b")
        (draft / MARKER).write_text("{}", encoding="utf-8")
    write(out, "c")
    assert names(tmp_path) == ["out/c", f"out/{MARKER}"]


def test_what_the_new_marker_keeps_stays_and_what_nobody_listed_cannot_be_kept(tmp_path: Path) -> None:
    out = tmp_path / "out"
    write(out, "a", "b", "c")
    (out / "mine").write_text("mine", encoding="utf-8")
    with result_folder(out).written() as draft:
        (draft / "c").write_text("new", encoding="utf-8")
        (draft / MARKER).write_text(json.dumps({"kept": ["a", "mine", "../elsewhere"]}), encoding="utf-8")
    assert names(out) == ["a", "c", "mine", MARKER]
    assert json.loads((out / MARKER).read_text())["files"] == ["a", "c", MARKER]
    assert (out / "c").read_text() == "new"


@pytest.mark.parametrize("moved", range(4))
def test_the_run_after_a_kill_replaces_its_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, moved: int) -> None:
    out, calls = tmp_path / "out", []
    write(out, "a", "b")
    replace = Path.replace

    def until_killed(self: Path, target: Path) -> Path:
        if self.parent.name == "scratch" and self.suffix == "":
            calls.append(target)
            if len(calls) > moved:
                raise KeyboardInterrupt
        return replace(self, target)

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt) if moved < 3 else nullcontext():
        patch.setattr(Path, "replace", until_killed)
        write(out, "b", "c", "d")
    write(out, "c", "e")
    assert names(tmp_path) == ["out/c", "out/e", f"out/{MARKER}"]


def test_what_a_killed_worker_was_writing_is_no_result(tmp_path: Path) -> None:
    write(tmp_path / "out", "a", f".{32 * '0'}.draft.parquet", f"parts/.{32 * 'e'}.draft.js")
    assert names(tmp_path / "out") == ["a", MARKER]
