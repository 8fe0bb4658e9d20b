"""Each log belongs to one cylinder, by folder, path, table or a field, or is refused with the reason."""

import os
import re
from pathlib import Path
from typing import Any

import pytest

from cylinder_friction_monitoring.errors import MonitoringError
from cylinder_friction_monitoring.fleet.assignment import assigned
from cylinder_friction_monitoring.fleet.fleet_file import load_fleet
from cylinder_friction_monitoring.fleet.plan import Assignment, Fleet
from fleet_samples import write_fleet


@pytest.fixture
def fleet(tmp_path: Path) -> Fleet:
    return write_fleet(tmp_path, "press-1", "press-2")


Outcome = tuple[dict[str, list[str]], list[str]]


def of(fleet: Fleet, rule: Assignment, *names: str, folder: Path = Path("logs")) -> Outcome:
    own, refused = assigned({name: folder / name for name in names}, Fleet(fleet.cylinders, rule))
    reasons = [f"{each.file}: {each.reason}" for each in refused]
    return {name: [path.name for path in paths] for name, paths in own.items()}, reasons


def test_a_folder_or_a_pattern_in_the_path_names_the_cylinder(fleet: Fleet) -> None:
    own, refused = of(fleet, Assignment(), "press-1/2026/a.csv", "press-2/b.csv", "c.csv", "press-1/press-2/d.csv")
    assert own == {"press-1": ["a.csv"], "press-2": ["b.csv"]}
    assert refused == [
        "c.csv: belongs to no cylinder by the folders on its path; move the log, or correct `assign` in fleet.yaml",
        "press-1/press-2/d.csv: belongs to 2 cylinders, press-1, press-2, by the folders on its path; expected one",
    ]
    rule = Assignment("pattern", r"_(?P<cylinder>press-\d)_")
    own, (unknown,) = of(fleet, rule, "x_press-1_1.csv", "x_press-9_1.csv", "x_press-1_press-2_.csv")
    assert own == {"press-1": ["x_press-1_1.csv", "x_press-1_press-2_.csv"]}, "matches do not overlap"
    assert unknown.startswith("x_press-9_1.csv: belongs to the cylinder 'press-9' by the pattern '_(?P<cylinder>")
    assert unknown.endswith("in its path, which fleet.yaml does not list; add it, or correct it")


def test_a_table_lists_it(fleet: Fleet, tmp_path: Path) -> None:
    table = tmp_path / "which.csv"
    table.write_text("file;cylinder\na.csv;press-1\nold/*;press-2\n*/b.csv;press-1\n")
    own, refused = of(fleet, Assignment("table", table=table), "a.csv", "old/c.csv", "old/b.csv")
    assert own == {"press-1": ["a.csv"], "press-2": ["c.csv"]}
    assert refused == ["old/b.csv: belongs to 2 cylinders, press-1, press-2, by which.csv; expected one"]
    for text, words in (
        ("file,cylinder\na.csv,press-1\na.csv,press-2\n", "line 3: .a.csv. belongs to .press-1. already; keep one"),
        ("log,cylinder\n", "expected the columns file and cylinder, but got log,cylinder"),
    ):
        table.write_text(text)
        with pytest.raises(MonitoringError, match=f"which.csv.*{words}"):
            of(fleet, Assignment("table", table=table), "a.csv")


def test_a_field_of_the_log_states_it(fleet: Fleet, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("Machine: press-2\nt;p1\n0;1\n")
    (tmp_path / "b.csv").write_text("t;p1\n0;1\n")
    rule = Assignment("field", r"Machine:\s*(?P<cylinder>.+)")
    os.mkfifo(tmp_path / "pipe.csv")
    own, refused = of(fleet, rule, "a.csv", "b.csv", "gone.csv", "pipe.csv", folder=tmp_path)
    assert own == {"press-2": ["a.csv"]}
    assert refused[0].startswith("b.csv: belongs to no cylinder by the pattern 'Machine")
    assert "in its first 64 KiB" in refused[0]
    assert refused[1].startswith("gone.csv: cannot be read ([Errno 2]")
    assert refused[2].startswith("pipe.csv: belongs to no cylinder")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("cylinders: {a: {dimension: 1}}", "cylinders.a.dimension: unknown key; check its spelling against docs/"),
        ("cylinders: {a: {}}", "cylinders.a.dimensions: missing; see docs/monitoring.md"),
        ("cylinders: {}", "cylinders: Dictionary should have at least 1 item"),
        ("cylinders:\n  a: {}\n  b: {}\n  a: {}\n", "line 4: 'a' is there already, in line 2; keep one, or rename it"),
        ("[a, b]", "fleet.yaml: expected keys and values, but got "),
        ("cylinders: [a", "fleet.yaml: is no YAML of plain keys and values (while parsing"),
        ("assign: {by: table}\ncylinders: {a: {}}", "assign: by: table needs table"),
        ("assign: {by: pattern, pattern: x}\ncylinders: {a: {}}", "has no group (?P<cylinder>...)"),
    ],
)
def test_a_wrong_fleet_file_is_refused(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "fleet.yaml").write_text(text)
    with pytest.raises(MonitoringError, match=re.escape(words)):
        load_fleet(tmp_path / "fleet.yaml")


def test_a_fleet_file_is_read_as_its_owner_means_it(tmp_path: Path) -> None:
    fleet = write_fleet(tmp_path, "a")
    more = "cylinders:\n  no: {bulk_modulus_pa: 1e9, dead_volume_m3: 1.2E-4}\n"
    more += "  2026-03-01: {services: [{time: 2026-03-01, words: no}]}\n"
    (tmp_path / "fleet.yaml").write_text((tmp_path / "fleet.yaml").read_text().replace("cylinders:\n", more))
    read = load_fleet(tmp_path / "fleet.yaml").cylinders
    assert list(read) == ["no", "2026-03-01", "a"]
    assert (read["no"].bulk_modulus_pa, read["no"].dead_volume_m3) == (1e9, 1.2e-4)
    assert read["2026-03-01"].services[0].words == "no"
    assert read["a"] == fleet.cylinders["a"]


@pytest.mark.parametrize(
    ("name", "own", "words"),
    [
        ("../x", {}, "got the name '../x', expected letters"),
        ("A", {}, "A and a differ by case alone"),
        ("a", {"services": [{"time": "March"}]}, "got 'March', expected a time such as 2026-03-01"),
        ("a", {"limit_percent": {"wear": 3.0}}, "got indicator 'wear', but expected one of friction_n"),
        ("a", {"limit_percent": {"friction_n": -20.0}}, "limit_percent.friction_n: expected a positive number"),
        ("a", {"load": "heavy"}, "load: got 'heavy', expected none, measured, position, or a constant load in newtons"),
        ("a", {"baseline_sessions": 10}, "baseline_sessions must be at least 30, but got 10"),
        ("a", {"false_alarms_per_year": 2.0}, "false_alarms_per_year must be at most 1, but got 2.0"),
        ("a", {"bulk_modulus_pa": -1.0}, "bulk_modulus_pa must be a positive number, but got -1.0"),
        ("a", {"dimensions": {"bore_diameter_m": 63.0}}, "cylinders.a.dimensions.rod_diameter_m: missing"),
    ],
)
def test_wrong_names_services_and_limits_are_refused(
    tmp_path: Path, name: str, own: dict[str, Any], words: str
) -> None:
    with pytest.raises(MonitoringError, match=re.escape(words)):
        write_fleet(tmp_path, *sorted({name, "a"}), own={"a": own})
