"""The log: whole lines, rotation by size, and a disk that cannot be written."""

import json
import logging
from pathlib import Path

import pytest

from cylinder_friction.service.json_log import JsonLog, rotate


def lines(path: Path) -> list[int]:
    return [json.loads(line)["number"] for line in path.read_text("utf-8").splitlines()]


def test_workers_follow_a_rotated_log_and_old_files_are_dropped(tmp_path: Path) -> None:
    path = tmp_path / "access.jsonl"
    workers = [JsonLog(path, 0.0), JsonLog(path, 0.0)]
    for number in range(40):
        workers[number % 2].write({"number": number})
        rotate(path, max_bytes=139, files=2)  # ten lines or so
    kept = [lines(each) for each in (tmp_path / "access.jsonl.2", tmp_path / "access.jsonl.1", path) if each.exists()]
    numbers = [number for part in kept for number in part]
    assert numbers == list(range(numbers[0], 40))
    assert sorted(each.name for each in tmp_path.iterdir()) == ["access.jsonl", "access.jsonl.1", "access.jsonl.2"]


def test_a_small_log_stays(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "access.jsonl"
    JsonLog(path).write({"number": 1})
    rotate(path, max_bytes=1000, files=2)
    assert lines(path) == [1]
    rotate(tmp_path / "none", max_bytes=1000, files=2)
    assert caplog.records == []


def test_a_log_that_cannot_be_written_is_reported_once(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    folder = tmp_path / "logs"
    folder.mkdir()
    log = JsonLog(folder / "access.jsonl", 0.0)
    (folder / "access.jsonl").unlink()
    folder.rmdir()
    with caplog.at_level(logging.ERROR):
        for number in range(3):
            log.write({"number": number})
    assert len(caplog.records) == 1
    assert "nothing is logged" in caplog.text
    folder.mkdir()
    log.write({"number": 3})
    assert lines(folder / "access.jsonl") == [3]


def test_a_log_in_no_folder_is_refused_at_the_start(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        JsonLog(tmp_path / "none" / "access.jsonl")
