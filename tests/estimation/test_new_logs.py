"""A second run processes what is new: by content, without losing anything, and in the same bytes after a kill."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import time
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimation.from_logs import estimate_logs
from cylinder_friction.estimation.results import GONE, REFUSED, FrictionOfLogs, kept_recordings, restore_summary
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.recordings.recording import Recording
from logger_files import CHANNELS, STATED, write_log

KILLS = int(os.environ.get("KILLS", "4"))
Run = Callable[..., FrictionOfLogs]


@pytest.fixture
def folder(tmp_path: Path, twelve_recordings: list[Recording]) -> Path:
    """Return the folder of five logs; another seven lie in ``later``."""
    for number, recording in enumerate(twelve_recordings):
        write_log(tmp_path / f"{'logs' if number < 5 else 'later'}/log{number:02d}.csv", recording)
    return tmp_path / "logs"


@pytest.fixture
def run(folder: Path, cylinder: Cylinder) -> Run:
    def run(name: str = "out", folder: Path = folder, **options: object) -> FrictionOfLogs:
        given = {"channels": STATED} | options
        return estimate_logs(folder, cylinder, folder.with_name(name), **given)  # type: ignore[arg-type]

    return run


def deliver(folder: Path, *numbers: int) -> None:
    for number in numbers:
        shutil.copy2(folder.with_name("later") / f"log{number:02d}.csv", folder)


def content(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def names(result: FrictionOfLogs) -> list[str]:
    return [each.name for each in result.recordings]


def test_nothing_new_changes_nothing(run: Run, folder: Path) -> None:
    first = run()
    out = folder.with_name("out")
    before, changed = content(out), [path.stat().st_mtime_ns for path in sorted(out.rglob("*"))]
    again = run()
    assert again.new == ()
    assert (again.recordings, again.bounds) == (first.recordings, first.bounds)
    assert repr(again.offsets) == repr(first.offsets)
    assert content(out) == before
    assert [path.stat().st_mtime_ns for path in sorted(out.rglob("*"))] == changed


def test_new_files_leave_the_results_of_the_others_and_the_page_shows_all(run: Run, folder: Path) -> None:
    run()
    before = content(folder.with_name("out"))
    deliver(folder, 5, 6)
    result = run()
    assert result.new == ("log05", "log06")
    digest = hashlib.sha256((folder / "log05.csv").read_bytes()).hexdigest()
    assert result.recordings[5].source_sha256 == digest
    assert {"cylinder", "mapping", "model"} <= result.to_dict()["depends_on"].keys()
    assert names(result) == [f"log{number:02d}" for number in range(7)]
    after = content(folder.with_name("out"))
    assert before.items() - after.items() == {(name, before[name]) for name in ("friction.html", "summary.json")}
    assert all(f"#pane={name}" in after["friction.html"].decode() for name in names(result))


def test_with_a_model_runs_by_steps_give_the_same_bytes(run: Run, folder: Path, small_hybrid: HybridEstimator) -> None:
    run(model=small_hybrid)
    deliver(folder, 5, 6)
    run(model=small_hybrid)
    run("whole", model=small_hybrid)
    by_steps, at_once = (content(folder.with_name(name)) for name in ("out", "whole"))
    for name in ("summary.json", "friction.html"):  # where results lie, and what was new, differs
        by_steps.pop(name), at_once.pop(name)
    assert by_steps == at_once


def test_offsets_of_new_sessions_are_identified_beside_those_of_before(run: Run, folder: Path) -> None:
    first = run()
    deliver(folder, *range(5, 12))
    result = run()
    assert {each.source for each in first.offsets} == {"strokes in both directions"}
    assert first.offsets[0].words.startswith("deviation from the mean of 5 sessions of its condition")
    found = {each.session: each for each in result.offsets}
    assert repr([found[each.session] for each in first.offsets]) == repr(first.offsets)
    assert {found[f"log{number:02d}"].source for number in range(5, 12)} == {"strokes in both directions"}
    assert "12 sessions together, if friction is as asymmetric in each" in found["log11"].words


def test_a_file_is_known_by_its_content(run: Run, folder: Path) -> None:
    run()
    (folder / "log00.csv").touch()  # another date
    (folder / "log01.csv").rename(folder / "moved.csv")
    (folder / "log02.csv").unlink()
    shutil.copy2(folder / "log03.csv", folder / "log99.csv")  # delivered twice
    deliver(folder, 7)
    (folder / "log07.csv").replace(folder / "log04.csv")  # another measurement under a known name
    result = run()
    assert result.new == ("log04", "moved")
    assert names(result) == ["log00", "log02", "log03", "log04", "moved"]
    assert [each.gone for each in result.recordings] == ["", GONE, "", "", ""]
    (copy,) = result.refused
    assert copy.file == "log99.csv"
    assert copy.reason.startswith("holds the same samples as recording 'log03' of log03.csv; a copy would be counted")
    assert not (folder.with_name("out") / "log01.parquet").exists()
    assert (folder.with_name("out") / "log02.parquet").exists()
    (folder / "log99.csv").unlink()
    deliver(folder, 8)
    (folder / "log08.csv").rename(folder / "log02.csv")
    assert run().recordings[1].gone == ""


def test_a_refused_file_is_tried_again(run: Run, folder: Path) -> None:
    good = (folder / "log04.csv").read_bytes()
    (folder / "log04.csv").write_bytes(good[: len(good) // 2] + b"overload\n" + good[len(good) // 2 :])
    assert [each.file for each in run().refused] == ["log04.csv"]
    again = run()
    assert ([each.file for each in again.refused], again.new) == (["log04.csv"], ())
    (folder / "log04.csv").write_bytes(good)
    assert (run().refused, run().new) == ([], ())


@pytest.mark.parametrize("damaged", [b"", b"\0\1\2", b"t,p1\n1,2\n"])
def test_a_log_that_is_damaged_later_keeps_its_result_and_is_named(run: Run, folder: Path, damaged: bytes) -> None:
    run()
    good, before = (folder / "log02.csv").read_bytes(), content(folder.with_name("out"))
    (folder / "log02.csv").write_bytes(damaged)
    for _ in range(2):
        result = run()
        assert ([each.file for each in result.refused], result.new) == (["log02.csv"], ())
        assert [each.gone for each in result.recordings] == ["", "", REFUSED, "", ""]
        assert not any(each.outdated for each in result.recordings)
        assert content(folder.with_name("out"))["log02.parquet"] == before["log02.parquet"]
    (folder / "log02.csv").write_bytes(good)
    result = run()
    assert (result.refused, result.new, [each.gone for each in result.recordings]) == ([], (), [""] * 5)


def test_a_log_that_became_shorter_is_named(run: Run, folder: Path) -> None:
    run()
    lines = (folder / "log02.csv").read_text().splitlines(keepends=True)
    (folder / "log02.csv").write_text("".join(lines[: len(lines) // 2]))
    with pytest.warns(UserWarning, match=r"log02.csv: has become shorter, \d+\.\d s instead of \d+\.\d s"):
        assert run().new == ("log02",)


def test_a_mistyped_mapping_removes_no_result(run: Run, folder: Path) -> None:
    run()
    before = content(folder.with_name("out"))
    wrong = STATED | {"position_m": STATED["position_m"] | {"channel": "xx"}}
    result = run(channels=wrong)
    assert len(result.refused) == 5
    assert all(each.outdated and each.gone.startswith(REFUSED) for each in result.recordings)
    result = run()
    assert (result.refused, result.new) == ([], ())
    assert not any(each.outdated or each.gone for each in result.recordings)
    assert content(folder.with_name("out")).keys() == before.keys()


@pytest.mark.parametrize(("name", "shown"), [(b"a\xff.csv", "a\\udcff.csv"), (b"a\n.csv", "a\\u000a.csv")])
@pytest.mark.parametrize("options", [{}, {"channels": None, "units": {"pressure": "bar", "length": "mm", "time": "s"}}])
def test_a_name_that_is_no_text_costs_only_its_own_file(
    run: Run, folder: Path, name: bytes, shown: str, options: dict[str, object]
) -> None:
    shutil.copy2(folder / "log00.csv", os.fsencode(folder) + b"/" + name)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # the guessed mapping
        result = run(**options)
    assert ([each.file for each in result.refused], len(result.recordings)) == ([shown], 5)
    assert "rename it" in result.refused[0].reason
    out = folder.with_name("out")
    assert json.loads((out / "summary.json").read_text())["refused"][0]["file"] == shown
    assert shown in (out / "friction.html").read_text()


def test_pipes_and_links_to_nothing_are_refused_by_name(run: Run, folder: Path) -> None:
    os.mkfifo(folder / "a.csv")
    (folder / "b.csv").symlink_to("gone.csv")
    (folder / "log01.csv").replace(folder.with_name("log01.csv"))
    (folder / "log01.csv").symlink_to(folder.with_name("log01.csv"))
    result = run()
    reasons = {each.file: each.reason for each in result.refused}
    assert (names(result), list(reasons)) == ([f"log{number:02d}" for number in range(5)], ["a.csv", "b.csv"])
    assert "is no regular file; copy what comes from it into one" in reasons["a.csv"]
    assert "No such file" in reasons["b.csv"]
    folder.with_name("log01.csv").unlink()
    result = run()
    assert [each.file for each in result.refused] == ["a.csv", "b.csv", "log01.csv"]
    assert result.recordings[1].gone == REFUSED


def test_a_session_that_gets_another_file_is_identified_again_as_a_whole(run: Run, folder: Path) -> None:
    pattern = r"(?P<session>(?P<condition>log)0)"
    run(names=pattern)
    deliver(folder, 5)
    result = run(names=pattern)
    assert result.new == tuple(f"log{number:02d}" for number in range(6))


def test_another_cylinder_or_mapping_begins_anew_and_loses_nothing(run: Run, folder: Path, cylinder: Cylinder) -> None:
    run()
    (folder / "log02.csv").unlink()
    result = run(channels=CHANNELS)
    assert result.new == ("log00", "log01", "log03", "log04")
    assert result.recordings[2].gone == f"{GONE}; it was processed with another mapping"
    assert (folder.with_name("out") / "log02.parquet").exists()
    other = replace(cylinder, moving_mass_kg=7.0)
    result = estimate_logs(folder, other, folder.with_name("out"), channels=CHANNELS, file_format="csv")
    assert result.new == ("log00", "log01", "log03", "log04")
    written = {path.name for path in folder.with_name("out").glob("log*")}
    assert written == {*(f"log0{each}.parquet" for each in range(5)), *(f"log0{each}.csv" for each in (0, 1, 3, 4))}


@pytest.mark.parametrize("stroke_m", [0.25, 0.3])
@pytest.mark.parametrize("shared", [(), ("log01.csv",)])
def test_another_cylinders_logs_of_the_same_names_replace_nothing(
    run: Run, folder: Path, cylinder: Cylinder, stroke_m: float, shared: tuple[str, ...]
) -> None:
    run()
    out, second = folder.with_name("out"), folder.with_name("second")
    before = content(out)
    second.mkdir()
    shutil.copy2(folder.with_name("later") / "log05.csv", second / "log00.csv")
    for name in shared:
        shutil.copy2(folder / name, second)
    with pytest.raises(FileExistsError, match=r"another log00\.csv") as refused:
        estimate_logs(second, replace(cylinder, stroke_m=stroke_m), out, channels=STATED)
    assert content(out) == before
    assert (str(folder / "log00.csv") in str(refused.value), "--output" in str(refused.value)) == (True, True)
    assert ("another cylinder" in str(refused.value)) == (stroke_m != cylinder.stroke_m)
    both = estimate_logs([folder, second], cylinder, out, channels=STATED)
    assert "second-log00" in names(both)


def test_a_log_that_is_written_again_replaces_its_result_wherever_the_logs_lie(run: Run, folder: Path) -> None:
    run()
    shutil.copy2(folder.with_name("later") / "log05.csv", folder / "log00.csv")
    assert run().new == ("log00",)
    shutil.copytree(folder, moved := folder.with_name("moved"))
    shutil.copy2(folder.with_name("later") / "log06.csv", moved / "log00.csv")
    assert run(folder=moved).new == ("log00",)


@pytest.mark.parametrize("name", ["log03.parquet", "panes/log03.js"])
def test_a_removed_file_of_a_result_is_made_again(run: Run, folder: Path, name: str) -> None:
    run()
    before = content(folder.with_name("out"))
    (folder.with_name("out") / name).unlink()
    assert run().new == ("log03",)
    after = content(folder.with_name("out"))
    before.pop("summary.json"), after.pop("summary.json")  # which states what was new
    assert after == before


def test_a_recording_of_several_counts_with_the_others_of_its_log(run: Run, folder: Path) -> None:
    log = (folder / "log03.csv").read_text().splitlines(keepends=True)
    (folder / "log03.csv").write_text("".join([*log[:2000], *log[2300:]]))
    run()
    (folder.with_name("out") / "log03_part2.parquet").unlink()
    assert run().new == ("log03_part1", "log03_part2")


@pytest.mark.extended
def test_after_a_kill_at_any_moment_the_next_run_ends_in_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    def command(out: str) -> subprocess.Popen[bytes]:
        sizes = "bore_diameter_m=0.063,rod_diameter_m=0.028,stroke_m=0.25,moving_mass_kg=6"
        given = [str(folder), "--cylinder", sizes, "--channels", str(mapping), "--output", str(tmp_path / out)]
        estimate = [sys.executable, "-m", "cylinder_friction.commands.cli", "estimate"]
        return subprocess.Popen([*estimate, *given], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    mapping = tmp_path / "press.yaml"
    mapping.write_text(f"channels: {STATED!r}\n", encoding="utf-8")
    assert command("begun").wait() == 0
    deliver(folder, 5, 6, 7)
    shutil.copytree(tmp_path / "begun", tmp_path / "expected")
    started = time.monotonic()
    assert command("expected").wait() == 0
    whole_s = time.monotonic() - started
    expected = content(tmp_path / "expected")
    for kill in range(KILLS):
        out = f"out{kill}"
        shutil.copytree(tmp_path / "begun", tmp_path / out)
        process = command(out)
        try:
            process.wait(timeout=whole_s * (kill + 1) / KILLS)
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGKILL)
            process.wait()
        assert command(out).wait() == 0
        written = content(tmp_path / out)
        for each in (written, expected):  # which state what was new
            each.pop("summary.json", None)
        assert written == expected


def test_a_damaged_summary_is_written_anew_from_the_results(run: Run, folder: Path) -> None:
    run()
    out = folder.with_name("out")
    known, summary = kept_recordings(out), out / "summary.json"
    summary.write_bytes(summary.read_bytes()[:100])
    assert restore_summary(out).startswith("JSONDecodeError: ")
    assert (kept_recordings(out), restore_summary(out)) == (known, "")
    assert run().new == ()
    assert restore_summary(folder.with_name("none")) == ""
