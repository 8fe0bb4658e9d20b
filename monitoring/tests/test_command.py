"""The command ``monitor``: what it prints, its exit status, and entries."""

import json
from pathlib import Path

import pytest

from cylinder_friction.commands.cli import main
from cylinder_friction.execution.ports import free_port
from cylinder_friction.recordings.recording import Recording
from cylinder_friction_monitoring.fleet.nightly import FleetHealth
from cylinder_friction_monitoring.night import _print as print_health
from cylinder_friction_monitoring.trends.cylinder_line import line_of
from cylinder_friction_monitoring.trends.verdict import assess
from fleet_samples import write_fleet, write_session
from health_rows import sessions
from packed_pages import unpacked_pane


@pytest.fixture
def folder(tmp_path: Path, labelled_recordings: list[Recording], monkeypatch: pytest.MonkeyPatch) -> Path:
    write_session(tmp_path / "logs/a/2026-03-01.csv", labelled_recordings[0])
    write_fleet(tmp_path, "a", "b")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_run_prints_what_needs_a_person_and_where_the_page_is(
    folder: Path, capsys: pytest.CaptureFixture[str], labelled_recordings: list[Recording]
) -> None:
    assert main(["monitor", "logs"]) == 0
    printed = capsys.readouterr().out
    assert "a: 1 new session\n" in printed
    assert "not yet   a: " in printed
    assert "fine      0 of 2 cylinders\n\npage     health/health.html\n" in printed
    files = "announced.json cylinders friction health.html health.json health.sqlite panes sessions"
    assert sorted(path.name for path in (folder / "health").iterdir()) == files.split()
    write_session(folder / "logs/nobody/2026-03-02.csv", labelled_recordings[1])
    assert main(["monitor", "logs", "--json"]) == 1
    content = json.loads(capsys.readouterr().out)
    assert [each["file"] for each in content["refused"]] == ["logs/nobody/2026-03-02.csv"]
    assert content["new_alarms"] == []


def test_a_registry_that_cannot_be_reached_costs_only_those_whose_model_it_holds(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MLFLOW_TRACKING_URI", f"http://127.0.0.1:{free_port()}")
    write_fleet(folder, "a", "b", own={"b": {"model": "models:/friction-estimator@champion"}})
    assert main(["monitor", "logs"]) == 1
    printed = capsys.readouterr().out
    assert "a: 1 new session\n" in printed
    assert "b: refused: its new logs wait for the next run: http://127.0.0.1" in printed
    assert "<strong>b</strong>: its new logs wait for the next run" in (folder / "health/health.html").read_text()


def test_a_late_log_is_printed_once(
    folder: Path, capsys: pytest.CaptureFixture[str], labelled_recordings: list[Recording]
) -> None:
    assert main(["monitor", "logs"]) == 0
    write_session(folder / "logs/a/2026-01-02.csv", labelled_recordings[1])
    capsys.readouterr()
    for _ in range(2):  # on that night and on the following one
        assert main(["monitor", "logs"]) == 1
        assert capsys.readouterr().out.count("begins at 2026-01-02") == 1


def test_a_fine_cylinder_that_needs_a_look_counts_as_fine(capsys: pytest.CaptureFixture[str]) -> None:
    rows = sessions(100)
    line = line_of(assess("press", rows), rows, {}, "", late=1)
    print_health(FleetHealth(Path("health"), (line,), (), (), (), ()), as_json=False)
    printed = capsys.readouterr().out
    assert "fine      press: " in printed
    assert "fine      1 of 1 cylinders" in printed


def test_an_entry_is_added_and_the_cylinder_assessed(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["monitor", "logs"]) == 0
    given = ["--name", "Kim", "--words", "rod seal changed", "--time", "2026-03-02T10:00Z"]
    assert main(["monitor", "--entry", "a", "service", *given]) == 0
    entry = json.loads((folder / "health/entries.jsonl").read_text())
    assert (entry["name"], entry["time"], entry["words"]) == ("Kim", "2026-03-02T10:00Z", "rod seal changed")
    capsys.readouterr()
    belong = "--name, --words, --time, --until and --of belong to an entry; give --entry CYLINDER KIND"
    for wrong, words in (
        (["--entry", "c", "service", "--name", "Kim"], "entry: unknown cylinder 'c'; expected one of a, b"),
        (["--name", "Kim"], belong),
        (["--fleet", "none.yaml"], "none.yaml: no such file; write one that names your cylinders"),
        (["nothing"], "nothing: no such file"),
    ):
        assert main(["monitor", *wrong]) == 1
        assert f"cylinder-friction monitor: {words}" in capsys.readouterr().err
    assert len((folder / "health/entries.jsonl").read_text().splitlines()) == 1


def test_an_entry_of_a_mistyped_year_is_asked_about_and_withdrawn(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["monitor", "logs"]) == 0
    service = ["monitor", "--entry", "a", "service", "--name", "Kim", "--words", "rod seal changed"]
    assert main([*service, "--time", "2226-03-02"]) == 0
    question = "is the date right? the service of 2226-03-02 (entered by Kim) has not come"
    assert question in unpacked_pane(folder / "health/panes/a.js")
    capsys.readouterr()
    withdraw = ["monitor", "--entry", "a", "withdraw", "--name", "Lee", "--of", "service"]
    why, known = ("--words", "a mistyped year"), "of which these are in force: service 2226-03-02T00:00:00.000Z"
    for given, refusal in (
        ((*withdraw, "2226-03-02"), "no reason; state why the entry is withdrawn, with --words"),
        ((*withdraw, "2225", *why), f"--of service 2225: expected the kind and time of one entry of a, {known}"),
        ((*withdraw, "2226-03-02", *why), ""),
    ):
        assert main([*given]) == bool(refusal)
        assert capsys.readouterr().err == (f"cylinder-friction monitor: entry: {refusal}\n" if refusal else "")
    pane = unpacked_pane(folder / "health/panes/a.js")
    assert "rod seal changed (withdrawn by Lee: a mistyped year)" in pane
    assert "service 2226-03-02T00:00:00.000Z: a mistyped year" in pane
