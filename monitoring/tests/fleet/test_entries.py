"""Entries are added by name and time, and never changed."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from cylinder_friction_monitoring.errors import MonitoringError, Refused
from cylinder_friction_monitoring.fleet.entries import ENTRIES_FILE, add_entry, entries_of
from cylinder_friction_monitoring.trends.assessment import Entry
from fleet_samples import write_fleet


def test_entries_are_kept_in_the_order_of_time_beside_services(tmp_path: Path) -> None:
    fleet = write_fleet(tmp_path, "a", "b", own={"a": {"services": [{"time": "2026-02-01", "words": "oil"}]}})
    add_entry(tmp_path, Entry("a", "2026-03-01T12:00+02:00", "Kim", "comment", "a scratch, ü"), fleet)
    first = (tmp_path / ENTRIES_FILE).read_bytes()
    add_entry(tmp_path, Entry("a", "2026-01-01", "Lee", "acknowledge"), fleet)
    assert (tmp_path / ENTRIES_FILE).read_bytes().startswith(first)
    found = entries_of(tmp_path, fleet)
    assert [(each.time, each.name, each.kind) for each in found["a"]] == [
        ("2026-01-01T00:00:00.000Z", "Lee", "acknowledge"),
        ("2026-02-01T00:00:00.000Z", "fleet.yaml", "service"),
        ("2026-03-01T10:00:00.000Z", "Kim", "comment"),
    ]
    assert found["b"] == []


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"cylinder": "c"}, "entry: unknown cylinder 'c'; expected one of a"),
        ({"time": "yesterday"}, "entry: time: got 'yesterday', expected a time such as"),
        ({"name": " "}, "entry: no name; state who makes it, with --name"),
        ({"until": "2026-02-01"}, "entry: --until belongs to acknowledge, but got reset"),
        ({"kind": "acknowledge", "until": "May"}, "entry: until: got 'May', expected a time such"),
        ({"withdraws": "x"}, "entry: --of belongs to withdraw, but got reset"),
        ({"kind": "note"}, "entry: got the kind 'note', expected one of service, reset"),
    ],
)
def test_what_is_no_entry_is_refused(tmp_path: Path, wrong: dict[str, Any], words: str) -> None:
    with pytest.raises(MonitoringError, match=re.escape(words)):
        add_entry(tmp_path, replace(Entry("a", "2026-01-01", "Kim", "reset"), **wrong), write_fleet(tmp_path, "a"))
    assert not (tmp_path / ENTRIES_FILE).exists()


def test_a_damaged_line_is_named(tmp_path: Path) -> None:
    fleet = write_fleet(tmp_path, "a")
    add_entry(tmp_path / "other", Entry("a", "2026-01-01", "Kim", "comment"), fleet)
    whole = (tmp_path / "other" / ENTRIES_FILE).read_text()
    (tmp_path / ENTRIES_FILE).write_text(f'{{"cylinder": "a"}}\n{whole}{whole[:40]}')
    with pytest.raises(MonitoringError, match=r"entries.jsonl, line 1: is no entry"):
        add_entry(tmp_path, Entry("a", "2026-01-01", "Kim", "comment"), fleet)
    damaged = list[Refused]()
    assert len(entries_of(tmp_path, fleet, damaged)["a"]) == 1
    assert [each.file for each in damaged] == ["entries.jsonl, line 1", "entries.jsonl, line 3"]


def test_an_entry_is_withdrawn_by_a_later_one_and_so_is_a_withdrawal(tmp_path: Path) -> None:
    fleet = write_fleet(tmp_path, "a", own={"a": {"services": [{"time": "2027-03-01"}]}})

    def add(time: str, kind: str, of: str = "") -> list[tuple[str, bool]]:
        add_entry(tmp_path, Entry("a", time, "Kim", kind, "why", withdraws=of), fleet)  # type: ignore[arg-type]
        return [(f"{each.kind} {each.time[:10]}", bool(each.withdrawn)) for each in entries_of(tmp_path, fleet)["a"]]

    add("2026-03-01", "reset")
    assert add("2026-03-02", "withdraw", "service 2027-03-01")[-1] == ("service 2027-03-01", True)
    found = add("2026-03-03", "withdraw", "reset 2026-03-01T00:00")
    assert [name for name, withdrawn in found if withdrawn] == ["reset 2026-03-01", "service 2027-03-01"]
    found = add("2026-03-04", "withdraw", "withdraw 2026-03-03")
    assert [name for name, withdrawn in found if withdrawn] == ["withdraw 2026-03-03", "service 2027-03-01"]
    add("2026-03-05", "withdraw", "reset 2026-03-01")
    assert ("reset 2026-03-01", False) in add("2026-03-01", "reset"), "entered again"
