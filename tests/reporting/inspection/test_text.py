"""The checks as text, and the outcome of a file."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from cylinder_friction.recordings.checks.finding import Finding
from cylinder_friction.reporting.inspection.subject import Inspected
from cylinder_friction.reporting.inspection.text import text_report

if TYPE_CHECKING:
    from cylinder_friction.recordings.recording import Recording

RATE = Finding("rate", "ok", "200 Hz throughout")
SPIKES = Finding("spikes", "repaired", "pressure_1_pa: 3 spikes taken out")
UNIT = Finding("unit", "refused", "position_m is 251 m in row 5")


def test_one_line_a_check_and_a_closing_line(strokes: Recording) -> None:
    report = text_report(
        [
            Inspected("a.csv", [RATE], strokes),
            Inspected("b.csv", [RATE, SPIKES], strokes),
            Inspected("c.csv", [UNIT]),
        ]
    )
    assert report == (
        "a.csv: ok\n"
        "  ok        rate  200 Hz throughout\n"
        "\n"
        "b.csv: repaired\n"
        "  ok        rate    200 Hz throughout\n"
        "  repaired  spikes  pressure_1_pa: 3 spikes taken out\n"
        "\n"
        "c.csv: refused\n"
        "  refused   unit  position_m is 251 m in row 5\n"
        "\n"
        "3 files: 1 ok, 1 repaired, 1 refused\n"
    )


def test_a_repair_that_no_finding_tells_is_told_once(strokes: Recording) -> None:
    repaired = replace(strokes, metadata=replace(strokes.metadata, repairs=("2 samples filled", SPIKES.text)))
    subject = Inspected("b.csv", [RATE, SPIKES], repaired, ("2 samples filled",))
    assert text_report([subject]).count("2 samples filled") == 1
    assert text_report([subject]).count(SPIKES.text) == 1
    assert Inspected("b.csv", [RATE], repaired).outcome == "repaired"


def test_without_a_recording_a_file_is_refused_whatever_the_checks_say() -> None:
    assert Inspected("a.csv", [RATE]).outcome == "refused"
    assert "became no recording" in text_report([Inspected("a.csv", [RATE])])


def test_pieces_of_one_file_are_named_and_count_once(strokes: Recording) -> None:
    second = replace(strokes, metadata=replace(strokes.metadata, name="strokes-2"))
    report = text_report([Inspected("a.csv", [RATE], strokes), Inspected("a.csv", [SPIKES], second)])
    assert "a.csv (strokes): ok" in report
    assert "a.csv (strokes-2): repaired" in report
    assert report.endswith("1 file: 1 repaired\n")


def test_nothing_inspected_is_no_error() -> None:
    assert text_report([]) == "0 files\n"
