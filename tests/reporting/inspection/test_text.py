"""The verdicts and the checks as text."""

from __future__ import annotations

from cylinder_friction.evaluation.inspection.subject import Inspected
from cylinder_friction.recordings.checks.limits import Finding
from cylinder_friction.reporting.inspection.text import text_report

RATE = Finding("rate", "ok", "200 Hz throughout")
SPIKES = Finding("spikes", "repaired", "pressure_1_pa: 3 spikes taken out")
UNIT = Finding("unit", "refused", "position_m is 251 m in row 5")


def test_one_line_a_file_and_what_is_not_in_order() -> None:
    friction = Finding("friction", "ok", "friction 302 N (half of extending less retracting at equal positions)")
    files = [Inspected("a.csv", [friction, RATE]), Inspected("b.csv", [RATE, SPIKES]), Inspected("c.csv", [UNIT])]
    assert text_report(files) == (
        "a.csv: usable for labelling; friction 302 N (half of extending less retracting at equal positions)\n"
        "b.csv: usable with these repairs\n"
        "  repaired  spikes  pressure_1_pa: 3 spikes taken out\n"
        "c.csv: not usable\n"
        "  refused   unit  position_m is 251 m in row 5\n"
        "\n"
        "3 files: 1 ok, 1 repaired, 1 refused\n"
    )


def test_the_worst_reason_is_the_verdict() -> None:
    noted = Finding("names", "noted", "no session")
    subject = Inspected("a.csv", [noted, SPIKES, RATE, UNIT])
    assert subject.verdict == "not usable: position_m is 251 m in row 5"
    assert subject.reasons == [UNIT.text, SPIKES.text, noted.text]
    assert Inspected("a.csv", [RATE, noted]).verdict == "usable for labelling; worth knowing: no session"


def test_pieces_of_one_file_are_named_and_count_once() -> None:
    report = text_report([Inspected("a.csv", [RATE], part=1), Inspected("a.csv", [SPIKES], part=2)])
    assert "a.csv (part 1): usable for labelling\n" in report
    assert "a.csv (part 2): usable with these repairs" in report
    assert report.endswith("1 file: 1 repaired\n")
