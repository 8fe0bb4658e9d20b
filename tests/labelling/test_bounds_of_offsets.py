"""Bounds hold most rows of each recording, although the offset's error is the same in all of them."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.made_recordings import made_recording

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimation.friction_of_logs import RecordingFriction
from cylinder_friction.labelling.known_offset import (
    STATED,
    STROKES,
    KnownOffset,
    OffsetEvidence,
    known_offsets,
    offset_evidence,
)
from cylinder_friction.labelling.label import Labeller
from cylinder_friction.labelling.sliding_blocks import OffsetPlan
from cylinder_friction.recordings.columns import LOAD_FORCE, PRESSURES, UNCERTAINTY_COLUMN
from cylinder_friction.recordings.recording import SensorUncertainty
from cylinder_friction.signals.zero_phase import default_filter

OFFSET = KnownOffset("s1", STROKES, "12 strokes", uncertainty_n=30.0, stated_n=70.0, offset_n=-12.5)


@pytest.mark.parametrize("load_n", [0.0, 40.0])
def test_nine_of_ten_rows_are_held_with_offset_and_load_at_their_limit(load_n: float) -> None:
    rows_n = np.random.default_rng(0).normal(0.0, 6.0, 100_000)
    half_n = OFFSET.half_n(np.full(len(rows_n), np.hypot(70.0, 2.0 * 6.0)), load_n)
    held = np.abs(np.hypot(30.0, load_n) + rows_n) <= half_n
    assert held.mean() == pytest.approx(0.9, abs=0.005)


def test_large_errors_of_rows_add_to_a_small_offset_in_quadrature() -> None:
    assert OFFSET.half_n(np.array([np.hypot(70.0, 400.0)])) == pytest.approx(np.hypot(30.0, 400.0))


@pytest.mark.parametrize(("words", "load_n"), [("", 0.0), ("4218 ± 40 N, as stated", 40.0)])
def test_only_a_stated_load_is_as_uncertain_in_all_sessions(
    words: str, load_n: float, cylinder: Cylinder, tmp_path: Path
) -> None:
    friction = RecordingFriction(Labeller(cylinder), default_filter(cylinder), None, words, tmp_path, 1)
    made = made_recording(cylinder)
    stated = replace(made.metadata, uncertainty={LOAD_FORCE: SensorUncertainty(zero=20.0, span=0.0)})
    label = replace(made.with_columns(**{UNCERTAINTY_COLUMN: np.full(len(made), 70.0)}), metadata=stated)
    found = friction.finished(label, OFFSET)
    half_n = 0.5 * (found.column("upper_n") - found.column("lower_n"))
    assert half_n == pytest.approx(np.hypot(30.0, load_n))
    assert found.column("friction_n") == pytest.approx(made.column("friction_n") + 12.5)


@pytest.mark.parametrize("times", [1.0, 2.0])
def test_offsets_hold_the_truth_where_zeros_are_worse_than_stated_and_that_is_named(
    times: float, cylinder: Cylinder
) -> None:
    draws, evidence, true_n = np.random.default_rng(5), list[OffsetEvidence](), dict[str, float]()
    for number in range(14):
        made = made_recording(cylinder, condition="12"[number % 2], session=f"s{number}", seed=number)
        stated = dict.fromkeys(PRESSURES, SensorUncertainty(5e3 / math.sqrt(3.0), 0.0))
        zero_1_pa, zero_2_pa = times * draws.uniform(-5e3, 5e3, 2)
        off_n = zero_1_pa * cylinder.piston_area_m2 - zero_2_pa * cylinder.annulus_area_m2
        label = replace(made, metadata=replace(made.metadata, uncertainty=stated))
        label, true_n[f"s{number}"] = label.with_columns(friction_n=made.column("friction_n") + off_n), off_n
        evidence.append(offset_evidence(label, cylinder, OffsetPlan(), math.nan, math.nan, ""))
    known = known_offsets(evidence, cylinder, OffsetPlan())
    off_n = [abs(true_n[each.session] - each.correction_n) for each in known]
    assert np.mean([off <= each.uncertainty_n for off, each in zip(off_n, known, strict=True)]) >= 0.85
    assert {("session to session" in each.doubt) for each in known} == {times == 2.0}
    if times == 2.0:
        assert known[0].doubt.endswith("bounds allow for 2.0 times the stated zeros")


def test_bounds_are_those_of_a_widened_interval_where_strokes_determine_nothing(
    cylinder: Cylinder, tmp_path: Path
) -> None:
    friction = RecordingFriction(Labeller(cylinder), default_filter(cylinder), None, "", tmp_path, 1)
    made = made_recording(cylinder)
    label = made.with_columns(**{UNCERTAINTY_COLUMN: np.full(len(made), 70.0)})
    found = friction.finished(label, KnownOffset("s1", STATED, "", uncertainty_n=140.0, stated_n=70.0))
    assert found.column("upper_n") - made.column("friction_n") == pytest.approx(140.0)
