"""Runs over a fleet: only what is new, nothing twice, nothing lost, whatever ends a run."""

import json
import os
import shutil
import sqlite3
import subprocess
import sys
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
import yaml

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.linear import RidgeEstimator
from cylinder_friction.recordings.recording import Recording
from cylinder_friction_monitoring.errors import MonitoringError
from cylinder_friction_monitoring.fleet import one_cylinder
from cylinder_friction_monitoring.fleet.database import SQLITE_FILE, update_database
from cylinder_friction_monitoring.fleet.entries import add_entry, entries_of
from cylinder_friction_monitoring.fleet.nightly import FleetHealth, monitor_fleet
from cylinder_friction_monitoring.fleet.plan import Fleet
from cylinder_friction_monitoring.fleet.processes import outcomes
from cylinder_friction_monitoring.trends.assessment import Entry
from fleet_samples import NOW, write_fleet, write_kept, write_session
from health_rows import changed
from health_rows import sessions as health_sessions
from packed_pages import unpacked_pane


@pytest.fixture
def folder(tmp_path: Path, labelled_recordings: list[Recording]) -> Path:
    """A folder with the logs of two cylinders, three and two sessions."""
    for day, recording in enumerate(labelled_recordings[:5], start=1):
        write_session(tmp_path / f"logs/{'a' if day < 4 else 'b'}/2026-03-0{day}.csv", recording)
    return tmp_path


@pytest.fixture
def fleet(folder: Path) -> Fleet:
    return write_fleet(folder, "a", "b")


def run(folder: Path, fleet: Fleet) -> FleetHealth:
    return monitor_fleet([folder / "logs"], fleet, folder / "health", NOW)


def sessions(folder: Path, name: str) -> list[dict[str, Any]]:
    return pq.read_table(folder / f"health/sessions/{name}.parquet").to_pylist()


def files(folder: Path) -> dict[str, bytes]:
    """Return what the runs wrote, without the friction of single recordings."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted((folder / "health").rglob("*"))
        if path.is_file() and "friction/" not in path.as_posix()
    }


PAGES = {"health/health.json", "health/health.html"}


def of(name: str) -> set[str]:
    """Return the files of one cylinder."""
    return {f"health/{each}" for each in (f"cylinders/{name}.json", f"panes/{name}.js", f"sessions/{name}.parquet")}


def reasons(health: FleetHealth) -> list[str]:
    return [f"{each.where}: {each.reason}" for each in health.refused]


def with_own(fleet: Fleet, name: str, **own: Any) -> Fleet:
    """Return a fleet whose fleet file states something else of one cylinder."""
    return Fleet({**fleet.cylinders, name: replace(fleet.cylinders[name], **own)})


def test_a_weighed_load_is_subtracted(tmp_path: Path, cylinder: Cylinder, labelled_recordings: list[Recording]) -> None:
    pressure_pa = labelled_recordings[0].column("pressure_1_pa")
    hung = labelled_recordings[0].with_columns(pressure_1_pa=pressure_pa + 7848.0 / cylinder.piston_area_m2)
    write_session(tmp_path / "logs/hung/2026-03-01.csv", hung)
    write_session(tmp_path / "logs/free/2026-03-01.csv", labelled_recordings[0])
    fleet = write_fleet(tmp_path, "hung", "free", own={"hung": {"load": "7848+-40"}, "free": {"load": 0}})
    assert run(tmp_path, fleet).status == 0
    (hung_row,), (free_row,) = sessions(tmp_path, "hung"), sessions(tmp_path, "free")
    assert hung_row["load_n"] == pytest.approx(7848.0)
    for name in ("friction_n", "half_sum_n"):
        assert hung_row[name] == pytest.approx(free_row[name], abs=1.0)


def test_each_night_only_what_is_new(folder: Path, fleet: Fleet, labelled_recordings: list[Recording]) -> None:
    health = run(folder, fleet)
    assert (health.status, health.refused, health.new_alarms) == (0, (), ())
    assert [each["session"] for each in sessions(folder, "a")] == ["a-2026-03-01", "a-2026-03-02", "a-2026-03-03"]
    assert sessions(folder, "a")[0]["friction_n"] == pytest.approx(300.0, rel=0.2)
    assert health.news[0] == "a: 3 new sessions"
    listed = json.loads((folder / "health/health.json").read_text())["cylinders"]
    answers = [(each["cylinder"], each["answer"], each["ne107"]) for each in listed]
    assert answers == [("a", "not yet", "NORMAL"), ("b", "not yet", "NORMAL")]
    before = files(folder)
    again = run(folder, fleet)
    assert (again.news, files(folder)) == ((), before)
    write_session(folder / "logs/b/2026-03-06.csv", labelled_recordings[5])
    third = run(folder, fleet)
    assert third.news == ("b: 1 new session",)
    assert {name for name, content in files(folder).items() if before.get(name) != content} == PAGES | of("b")
    shutil.rmtree(folder / "logs/a")  # the logger's disk was emptied: nothing is lost
    (folder / "logs/a").mkdir()
    run(folder, fleet)
    assert len(sessions(folder, "a")) == 3


@pytest.mark.extended
@pytest.mark.parametrize(
    "seen", ["health/friction/a/summary.json", "health/friction/.b.draft", ".health.draft/whole", "health/panes/a.js"]
)
def test_a_process_that_is_killed_loses_nothing(folder: Path, fleet: Fleet, seen: str) -> None:
    run(folder, fleet)
    expected = files(folder)
    shutil.rmtree(folder / "health")
    program = [sys.executable, "-m", "cylinder_friction.commands.cli", "monitor", "logs", "--workers", "1"]
    with subprocess.Popen(program, cwd=folder, stdout=subprocess.DEVNULL) as process:
        while not (folder / seen).exists() and process.poll() is None:
            pass
        process.kill()
    if any((folder / "health/cylinders").glob("*.json")):
        expected.pop("health/health.html")  # it states news, which are none once a cylinder's state is there
    run(folder, fleet)
    own = {name: content for name, content in files(folder).items() if name in expected}
    state, whole = (json.loads(each.pop("health/health.json")) for each in (own, expected))
    assert state | {"news": []} == whole | {"news": []}  # what was new may have been stated before the kill
    assert own == expected


def test_logs_of_nobody_copies_and_moved_logs_are_named_and_count_once(folder: Path, fleet: Fleet) -> None:
    run(folder, fleet)
    shutil.copy2(folder / "logs/a/2026-03-01.csv", folder / "logs/b/copy 2026-03-01.csv")
    shutil.copy2(folder / "logs/a/2026-03-02.csv", folder / "logs/a/again 2026-03-02.csv")
    shutil.copy2(folder / "logs/a/2026-03-01.csv", folder / "logs/2026-03-01.csv")
    health = run(folder, fleet)
    assert health.status == 1
    nobodys, again, *same = reasons(health)
    assert nobodys.startswith("logs/2026-03-01.csv: belongs to no cylinder by the folders on its path; move the log")
    assert "2026-03-02.csv" in again
    assert same == [
        "a: a-2026-03-01: the same log lies with b; keep it with the cylinder that it is of",
        "b: b-copy 2026-03-01: the same log lies with a; keep it with the cylinder that it is of",
    ]
    assert [each.sessions for each in health.lines] == [2, 2]
    for wrong in ("logs/a/2026-03-01.csv", "logs/a/again 2026-03-02.csv", "logs/2026-03-01.csv"):
        (folder / wrong).unlink()
    moved, late = reasons(run(folder, fleet))
    assert moved == "a: a-2026-03-01: its log was moved to b, where it counts"
    assert late.startswith("b: b-copy 2026-03-01: begins at 2026-03-01, more than 3 days before")
    health = run(folder, with_own(fleet, "b", late="accept"))
    assert reasons(health) == [moved]
    assert {each.cylinder: each.sessions for each in health.lines} == {"a": 2, "b": 3}


def test_a_bad_log_costs_no_other(folder: Path, fleet: Fleet) -> None:
    bad = {"a/2026-03-09.csv": b"t,p1\n1,2\n", "b/2026-03-04.csv": b"\0\1", "b/2026-03-05.csv": b"\0\2"}
    for name, content in bad.items():
        (folder / "logs" / name).write_bytes(content)
        os.utime(folder / "logs" / name, (1e9, 1e9))
    health = run(folder, fleet)
    assert (health.status, {each.cylinder: each.sessions for each in health.lines}) == (1, {"a": 3, "b": 0})
    assert [each.where.partition(" (")[0] for each in health.refused] == [f"{name[0]}: {name}" for name in bad]


@pytest.mark.parametrize("step", ["estimate_logs", "assess"])
@pytest.mark.parametrize("nights", [0, 1])
def test_an_error_in_one_cylinder_costs_no_other_its_night(
    folder: Path, fleet: Fleet, labelled_recordings: list[Recording], step: str, nights: int
) -> None:
    for _ in range(nights):
        run(folder, fleet)
    write_session(folder / "logs/a/2026-03-09.csv", labelled_recordings[5])
    write_session(folder / "logs/b/2026-03-09.csv", labelled_recordings[6])
    whole = getattr(one_cylinder, step)

    def failing(first: Any, second: Any, *others: Any, **options: Any) -> Any:
        if "b" in (first, getattr(second, "name", "")):
            raise KeyError("no such column")
        return whole(first, second, *others, **options)

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(one_cylinder, step, failing)
        health = run(folder, fleet)
    outcome = {"estimate_logs": "took no log", "assess": "was not assessed"}[step]
    assert reasons(health) == [f"b: {outcome}, because of KeyError: 'no such column'"]
    assert (health.status, len(sessions(folder, "a"))) == (1, 4)
    (line,) = (each for each in health.lines if each.cylinder == "b")
    assert line.sessions == 2 * nights, "that of the night before"
    assert ("did not assess it" in line.look) == (step == "assess")
    assert f"<strong>b</strong>: {outcome}" in (folder / "health/health.html").read_text()
    assert (run(folder, fleet).refused, len(sessions(folder, "b"))) == ((), 3)


def test_a_process_that_dies_costs_no_other_job() -> None:
    """What ends a process, such as a lack of memory, ends only the job that needed it."""
    dead, answer, wrong = outcomes([partial(os._exit, 1), partial(pow, 2, 3), partial(int, "x")], 2)
    assert (answer, type(wrong)) == (8, ValueError)
    assert str(dead) == "its process died; it may have run out of memory"


def test_a_changed_bore_is_named_and_processed_anew_and_other_oil_scales_the_leak(folder: Path, fleet: Fleet) -> None:
    run(folder, fleet)
    before = sessions(folder, "a")
    wider = replace(fleet.cylinders["a"].dimensions, bore_diameter_m=0.064, rod_diameter_1_m=0.02)
    (folder / "logs/a/2026-03-01.csv").unlink()
    health = run(folder, with_own(fleet, "a", dimensions=wider))
    changes = "changes bore_diameter_m from 0.063 to 0.064, rod_diameter_1_m from 0 to 0.02: all its logs were"
    assert health.news[0].startswith(f"a: fleet.yaml {changes}")
    (reason,) = reasons(health)
    assert reason.startswith("a: a-2026-03-01: its file was not among the logs of the last run; it was processed with")
    assert "another cylinder" in reason
    after = sessions(folder, "a")
    same = [now["half_sum_n"] == was["half_sum_n"] for now, was in zip(after, before, strict=True)]
    assert same == [True, False, False]
    run(folder, with_own(fleet, "a", dimensions=wider, bulk_modulus_pa=2.0e9))
    for was, now in zip(after[1:], sessions(folder, "a")[1:], strict=True):
        assert now["friction_n"] == was["friction_n"]
        assert now["leak_m3_s_pa"] == pytest.approx(was["leak_m3_s_pa"] and 0.5 * was["leak_m3_s_pa"])


@pytest.mark.parametrize("place", ["logs", "logs/a"])
def test_a_name_that_is_no_text_costs_only_its_own_log(folder: Path, fleet: Fleet, place: str) -> None:
    bad = folder / place / os.fsdecode(b"x\xff.csv")
    shutil.copy(folder / "logs/a/2026-03-01.csv", bad)
    os.utime(bad, (1e9, 1e9))
    health = run(folder, fleet)
    (refused,) = health.refused
    assert (health.status, refused.file.endswith("x\\udcff.csv")) == (1, True)
    assert {each.cylinder: each.sessions for each in health.lines} == {"a": 3, "b": 2}
    assert "x\\udcff.csv" in (folder / "health/health.html").read_text().replace("<wbr>", "")


def test_a_log_that_is_damaged_later_stays_assessed_and_one_that_a_mapping_refuses_does_not(
    folder: Path, fleet: Fleet
) -> None:
    run(folder, fleet)
    before = sessions(folder, "a")
    (folder / "logs/a/2026-03-02.csv").write_bytes(b"")
    os.utime(folder / "logs/a/2026-03-02.csv", (1e9, 1e9))
    for _ in range(2):
        health = run(folder, fleet)
        assert (health.status, [each.file for each in health.refused]) == (1, ["a: a/2026-03-02.csv"])
        assert sessions(folder, "a") == before
    channels = yaml.safe_load((folder / "channels.yaml").read_text())
    wrong = {**channels["channels"], "position_m": {"channel": "xx", "unit": "mm"}}
    (folder / "channels.yaml").write_text(yaml.safe_dump(channels | {"channels": wrong}))
    health = run(folder, fleet)
    assert (health.status, [each.sessions for each in health.lines]) == (1, [0, 0])
    assert any("a-2026-03-01: the last run refused its file" in reason for reason in reasons(health))
    (folder / "channels.yaml").write_text(yaml.safe_dump(channels))
    assert {each.cylinder: each.sessions for each in run(folder, fleet).lines} == {"a": 3, "b": 2}


def test_the_fleet_file_corrects_a_start(folder: Path, fleet: Fleet, labelled_recordings: list[Recording]) -> None:
    write_session(folder / "logs/b/2027-03-06.csv", labelled_recordings[5])
    health = run(folder, fleet)
    (reason,) = reasons(health)
    assert reason.startswith("b: b-2027-03-06: its log states no start, others do")  # a future one is none
    (reason, _) = reasons(run(folder, with_own(fleet, "b", starts={"b-2027-3-06": "2026-03-06T00:00Z"})))
    words = "no session has this name; correct it in fleet.yaml"
    assert reason == f"b: starts: b-2027-3-06: {words}"
    health = run(folder, with_own(fleet, "b", starts={"b-2027-03-06": "2026-03-06T00:00Z"}))
    assert health.refused == ()
    last = sessions(folder, "b")[-1]
    assert (last["start"][:10], last["start_source"]) == ("2026-03-06", "fleet.yaml")


def test_a_model_is_held_to_the_label_and_one_of_another_bore_refused(
    folder: Path, labelled_recordings: list[Recording], cylinder: Cylinder
) -> None:
    ridge = RidgeEstimator().fit(labelled_recordings[:3])
    ridge.calibrate(labelled_recordings[:3], labelled_recordings[3:], cylinder)
    ridge.save(folder / "model")
    health = run(folder, write_fleet(folder, "a", "b", own={"a": {"model": "model"}}))
    assert health.refused == ()

    def held(name: str) -> list[dict[str, Any] | None]:
        return [json.loads(each["detail"])["row"]["held"] for each in sessions(folder, name)]

    assert held("b") == [None, None]
    assert all(each and each["stated"] == 0.9 and each["share"] > 0.5 for each in held("a"))
    state = folder / "health/cylinders/a.json"
    words = "The model has estimated 3 of the 90 sessions after which its bounds are tested."
    assert json.loads(state.read_text())["assessment"]["model"]["words"] == words
    assert words in unpacked_pane(folder / "health/panes/a.js")
    run(folder, write_fleet(folder, "a", "b"))
    assert held("a") == [None, None, None]
    assert json.loads(state.read_text())["assessment"]["model"] is None
    ridge.calibrate(labelled_recordings[:3], labelled_recordings[3:], replace(cylinder, bore_diameter_m=0.1))
    ridge.save(folder / "other")
    assert reasons(run(folder, write_fleet(folder, "a", "b", own={"a": {"model": "other"}})))[-1] == (
        "a: the model was trained for a cylinder of 100 mm bore and 28 mm rod, but the one given has 63 mm and 28 mm; "
        "correct `model` or `dimensions` in fleet.yaml"
    )


def worn_in_may(tmp_path: Path, **own: Any) -> tuple[Path, Fleet]:
    """Write a cylinder whose friction falls by a fifth in May, as an earlier run keeps it."""
    fleet = write_fleet(tmp_path, "press", "spare", own={"press": own})
    rows = changed(health_sessions(200), 150, times={"friction_n": 0.8, "breakaway_n": 0.8})
    write_kept(tmp_path / "health", fleet, rows)
    return tmp_path / "health", fleet


def test_a_service_in_the_future_hides_no_alarm_until_it_comes(tmp_path: Path) -> None:
    into, fleet = worn_in_may(tmp_path, services=[{"time": "2027-03-01", "words": "a mistyped year"}])
    health = monitor_fleet([], fleet, into, NOW)
    assert (health.status, health.lines[0].answer) == (3, "alarm")
    pane = unpacked_pane(into / "panes/press.js")
    assert "is the date right? the service of 2027-03-01 (entered by fleet.yaml) has not come" in pane
    assert monitor_fleet([], fleet, into, datetime(2027, 3, 2, tzinfo=UTC)).lines[0].answer == "alarm", "far away"
    planned = write_fleet(tmp_path, "press", "spare", own={"press": {"services": [{"time": "2025-08-01"}]}})
    assert monitor_fleet([], planned, into, datetime(2025, 7, 31, tzinfo=UTC)).lines[0].answer == "alarm"
    assert monitor_fleet([], planned, into, datetime(2025, 8, 2, tzinfo=UTC)).lines[0].answer == "not yet"


def test_an_alarm_is_new_until_it_was_announced_and_returns_as_a_new_one(tmp_path: Path) -> None:
    into, fleet = worn_in_may(tmp_path)

    def night(month: int, day: int, *, announced: bool = True) -> FleetHealth:
        health = monitor_fleet([], fleet, into, datetime(2025, month, day, tzinfo=UTC))
        if announced:
            health.announced()
        return health

    assert night(7, 20, announced=False).status == 3
    health = night(7, 20)
    assert (health.status, health.new_alarms) == (3, ("press",)), "the first run ended before it could say so"
    assert health.lines[0].headline == "friction -20 % since 2025-05-31"
    assert night(7, 20).status == 0
    add_entry(into, Entry("press", "2025-07-20", "Kim", "acknowledge", "seal is ordered"), fleet)
    line = night(7, 21).lines[0]
    assert (line.answer, line.rank, line.acknowledged) == ("watch", 4, "Kim, 2025-07-20: seal is ordered")
    assert "Acknowledged by Kim" in (into / "health.html").read_text()
    assert night(10, 17).new_alarms == ()
    assert night(10, 19).new_alarms == ("press",), "90 days later"
    assert night(10, 20).new_alarms == ()


def test_the_tables_follow_the_files(tmp_path: Path) -> None:
    into, fleet = worn_in_may(tmp_path)
    health = monitor_fleet([], fleet, into, NOW)
    assert update_database("", into, health.lines, entries_of(into, fleet)) == 2
    assert update_database("", into, health.lines, entries_of(into, fleet)) == 0
    with sqlite3.connect(into / SQLITE_FILE) as tables:
        ask = tables.execute
        answers = ask("SELECT cylinder, answer, needs FROM health_cylinder ORDER BY needs").fetchall()
        assert answers == [("press", "alarm", 0), ("spare", "not yet", 5)]
        changes = ask("SELECT indicator, round(percent), since FROM health_change").fetchall()
        assert changes == [("friction_n", -20.0, "s150"), ("breakaway_n", -20.0, "s150")]
        counted = "SELECT (SELECT count(friction_n_compensated) FROM health_session), count(*) FROM health_baseline"
        assert ask(counted).fetchone() == (200, 5)
    spare = tuple(each for each in health.lines if each.cylinder == "spare")
    assert update_database("", into, spare, {}) == 1
    with sqlite3.connect(into / SQLITE_FILE) as tables:
        assert tables.execute("SELECT count(*) FROM health_session").fetchone() == (0,)
    (into / SQLITE_FILE).write_bytes(b"no database at all, but long enough to be looked at" * 4)
    with pytest.raises(MonitoringError, match=r"health.sqlite are not up to date: .*; the page and the files are"):
        update_database("", into, health.lines, {})


DAMAGED = {
    "sessions/b.parquet": "its sessions are computed anew from the friction that is kept",
    "cylinders/b.json": "the cylinder is assessed anew",
    "friction/b/summary.json": "it was made anew from the results beside it",
    "announced.json": "alarms that were announced before count as new",
    "health.json": "it was made anew",
}


@pytest.mark.parametrize("damaged", DAMAGED)
def test_a_damaged_file_is_named_made_anew_and_costs_no_other_cylinder(
    folder: Path, fleet: Fleet, labelled_recordings: list[Recording], damaged: str
) -> None:
    run(folder, fleet).announced()
    expected, path = files(folder), folder / "health" / damaged
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    write_session(folder / "logs/a/2026-03-09.csv", labelled_recordings[5])
    shutil.rmtree(folder / "logs/b")  # so that the results of b are all that is left of it
    health = run(folder, fleet)
    (reason,) = reasons(health)
    assert reason.startswith(f"{damaged}: is damaged (")
    assert reason.endswith(DAMAGED[damaged])
    assert (health.status, health.news[0]) == (1, "a: 1 new session")
    health.announced()
    after = files(folder)
    assert {name for name, content in expected.items() if after[name] != content} == PAGES | of("a")
    assert reasons(run(folder, fleet)) == []


def test_a_file_that_somebody_removed_is_made_anew(folder: Path, fleet: Fleet) -> None:
    run(folder, fleet)
    expected = files(folder)
    for name in of("a"):
        (folder / name).unlink()
        assert "a: 3 new sessions" not in run(folder, fleet).news
        assert files(folder)[name] == expected[name]


def test_an_empty_folder_is_named(folder: Path, fleet: Fleet) -> None:
    run(folder, fleet)
    (folder / "usb").mkdir()
    health = monitor_fleet([folder / "usb"], fleet, folder / "health", NOW)
    (reason,) = reasons(health)
    assert reason.endswith("/usb: is an empty folder, so that no log was read from it; is its disk there?")
    assert {each.cylinder: each.sessions for each in health.lines} == {"a": 3, "b": 2}
