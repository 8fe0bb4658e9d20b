"""What the inspection states of each session's offset: where it is known from, and never more than is known."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.evaluation.inspection.subject import Inspected
from cylinder_friction.labelling.known_offset import KnownOffset, known_offsets
from cylinder_friction.labelling.label import Labeller
from cylinder_friction.labelling.sliding_blocks import OffsetPlan
from cylinder_friction.recordings.recording import Recording, SensorUncertainty
from cylinder_friction.reporting.inspection.text import text_report
from cylinder_friction.signals.smooth_signals import SignalFilter
from inspected_recordings import made_panes, made_strokes, write_page_of

Filters = dict[str, "SignalFilter"]
PLAN = OffsetPlan()
ZERO_PA = 5000.0
OFFSETS_N = (25.0, -5.0, -20.0, 10.0, -10.0, 15.0, -15.0, 5.0, -12.0, 12.0, 2.0, -7.0)
PRESSURES = ("pressure_1_pa", "pressure_2_pa")


def stated(recording: Recording, session: str = "s0") -> Recording:
    """Return a recording of a session whose sensors' zeros are stated as uncertain."""
    known = {name: SensorUncertainty(ZERO_PA, 0.0, zeroed=True) for name in PRESSURES}
    return replace(recording, metadata=replace(recording.metadata, session=session, uncertainty=known))


def known(recordings: list[Recording], cylinder: Cylinder, filters: Filters, no_offset: str = "") -> list[KnownOffset]:
    """Return what is known of the sessions of recordings, as the command asks for it."""
    labeller = Labeller(cylinder, load="measured" if no_offset else "none")
    subjects = [Inspected(f"{number}.csv", [], each) for number, each in enumerate(recordings)]
    panes, _ = made_panes(subjects, labeller, filters, plan=PLAN, no_offset=no_offset)
    return known_offsets([each.offset for each in panes if each.offset is not None], cylinder, PLAN)


@pytest.fixture(scope="module")
def stated_n(cylinder: Cylinder) -> float:
    """Expanded uncertainty of the zeros, as friction."""
    return 2.0 * ZERO_PA * float(np.hypot(cylinder.piston_area_m2, cylinder.annulus_area_m2))


def test_strokes_in_both_directions_show_each_session_s_offset(
    cylinder: Cylinder, filters: Filters, stated_n: float
) -> None:
    recordings = [stated(made_strokes(cylinder, load), f"s{number}") for number, load in enumerate(OFFSETS_N)]
    offsets = known(recordings, cylinder, filters)
    assert [each.session for each in offsets] == [f"s{number}" for number in range(12)]
    assert np.corrcoef([each.offset_n for each in offsets], OFFSETS_N)[0, 1] > 0.99
    for each, true_n in zip(offsets, OFFSETS_N, strict=True):
        assert each.source == "strokes in both directions"
        assert abs(each.offset_n - true_n) < each.uncertainty_n < 0.7 * stated_n
        assert each.stated_n == pytest.approx(stated_n)
        assert "12 sessions together" in each.words


def test_the_mean_of_a_condition_may_be_an_asymmetry_of_its_own(cylinder: Cylinder, filters: Filters) -> None:
    alike = [stated(made_strokes(cylinder, load), f"s{number:02d}") for number, load in enumerate(OFFSETS_N)]
    differ = [
        replace(each, metadata=replace(each.metadata, condition=str(number % 3))) for number, each in enumerate(alike)
    ]
    for one, own in zip(known(alike, cylinder, filters), known(differ, cylinder, filters), strict=True):
        assert abs(own.offset_n - one.offset_n) < own.uncertainty_n - one.uncertainty_n
        assert 1.1 * one.uncertainty_n < own.uncertainty_n < own.stated_n
        assert "if friction is as asymmetric in each of a condition" in own.words


def test_strokes_in_one_direction_determine_nothing(cylinder: Cylinder, filters: Filters, stated_n: float) -> None:
    both = made_strokes(cylinder)
    out = both.column("position_m").max() + np.cumsum(np.abs(np.gradient(both.column("position_m"))))
    one_way = stated(both.with_columns(position_m=0.25 * (out - out.min()) / np.ptp(out)), "out")
    (found,) = known([one_way], cylinder, filters)
    assert found.value == f"unknown, ± {stated_n:.1f} N"
    assert found.words == (
        "not identified: strokes extending alone do not separate it from friction; record strokes retracting too"
    )


def test_a_load_that_nobody_stated_is_not_taken_for_an_offset(cylinder: Cylinder, filters: Filters) -> None:
    loads = (*OFFSETS_N, 900.0)
    *others, loaded = known([stated(made_strokes(cylinder, load), f"s{load:g}") for load in loads], cylinder, filters)
    assert [each.source for each in others] == ["strokes in both directions"] * 12
    assert math.isnan(loaded.offset_n)
    assert "N does not turn with the direction, while the stated zeros and an asymmetry of friction" in loaded.words


def test_where_nothing_is_stated_nothing_is_known(cylinder: Cylinder, filters: Filters) -> None:
    (found,) = known([made_strokes(cylinder)], cylinder, filters)
    assert (found.source, found.value) == ("nothing", "unknown")
    assert "the uncertainty of the zero of 'pressure_1_pa' is not stated" in found.words


def test_text_and_page_show_the_same(tmp_path: Path, strokes: Recording, cylinder: Cylinder, filters: Filters) -> None:
    offsets = [
        KnownOffset("s1", "strokes in both directions", "12 strokes", 7.25, 31.0, -12.5),
        KnownOffset("s<2>", "stated uncertainty", "not identified: one way", 31.0, 31.0),
    ]
    subjects = [Inspected("a.csv", [], strokes)]
    assert text_report(subjects, offsets).split("\n\n")[1] == (
        "offset that the sensors' zeros add to friction, by session (k = 2, about 95 %)\n"
        "  s1    -12.5 ± 7.2 N      strokes in both directions: 12 strokes\n"
        "  s<2>  unknown, ± 31.0 N  stated uncertainty: not identified: one way\n"
        "means above hold these offsets; `estimate` and the stage `offset` take off what strokes show"
    )
    assert "means above" not in text_report(subjects, offsets[1:])
    page = write_page_of(tmp_path / "page.html", subjects, Labeller(cylinder), filters, offsets)
    for words in ("Offset of the sensors' zeros", "s&lt;2&gt;", "-12.5", "7.2", "31.0", "not identified: one way"):
        assert words in page, words
