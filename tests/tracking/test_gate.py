"""The promotion gate: a table of cases, and laws that hold for any figures."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cylinder_friction.tracking.gate import Candidate, decide

CANDIDATE = Candidate(
    "friction-estimator",
    "models/hybrid",
    "ab" * 16 + ".dir",
    {"1": 2.0, "2": 1.5},
    "truth",
    0.1,
    {"data/raw/rig": "ef.dir"},
    {"train": {"layers": 2}},
    {"pressure_1_pa": [1e6], "pressure_2_pa": [9e5], "position_m": [0.12]},
    {"recipe": "default"},
)
ERROR = st.floats(0.0, 1e3)
FIGURES = st.dictionaries(st.sampled_from(["1", "2", "3", "4"]), ERROR, min_size=1)


@pytest.mark.parametrize(
    ("candidate", "incumbent", "promote", "reason"),
    [
        ({"1": 3.0}, None, True, "there is no incumbent"),
        ({"1": 3.0, "2": 3.0}, {"1": 4.0, "2": 3.0}, True, "%; worse in no condition"),
        ({"1": 1.0, "2": 3.2}, {"1": 4.0, "2": 3.0}, False, "worse in condition 2: 3.200 % against 3.000 %"),
        ({"1": 1.0, "2": 3.2}, {"1": 4.0, "2": 3.0}, False, "although better overall, mean error 2.100 %"),
        ({"1": 1.0, "2": 3.1}, {"1": 4.0, "2": 3.0}, True, "; worse in condition 2 by 0.100 percentage points, within"),
        ({"1": 1.0, "2": 3.1}, {"1": 4.0, "2": 3.0}, True, "within the tolerance of 0.15"),
        ({"1": 4.0, "2": 4.0}, {"1": 4.0, "2": 4.0}, False, "not better overall"),
        ({"1": 5.0, "2": 4.0}, {"1": 4.0, "2": 4.0}, False, "not better overall"),
        ({"1": math.nan}, {"1": 4.0}, False, "the candidate's error in condition 1 is nan"),
        ({"1": math.nan}, None, False, "the candidate's error in condition 1 is nan"),
        ({"1": 3.0}, {"1": math.inf}, False, "the incumbent's error in condition 1 is inf"),
    ],
)
def test_decides_as_the_table_says(
    candidate: dict[str, float], incumbent: dict[str, float] | None, promote: bool, reason: str
) -> None:
    promoted, why = decide(candidate, incumbent, tolerance_percent=0.15)
    assert promoted is promote
    assert reason in why


@given(st.data(), FIGURES, st.floats(0.0, 10.0))
def test_a_promoted_candidate_is_better_overall_and_nowhere_worse_than_tolerated(
    data: st.DataObject, candidate: dict[str, float], tolerance: float
) -> None:
    incumbent = data.draw(st.fixed_dictionaries(dict.fromkeys(candidate, ERROR)))
    if decide(candidate, incumbent, tolerance)[0]:
        assert sum(candidate.values()) < sum(incumbent.values())
        assert all(candidate[condition] <= incumbent[condition] + tolerance for condition in candidate)


@pytest.mark.parametrize("incumbent", [None, {"1": 2.5, "2": 1.5}])
def test_a_decision_comes_back_from_its_file(incumbent: dict[str, float] | None) -> None:
    decided = replace(CANDIDATE, promote=True, reason="promoted: better", incumbent=incumbent)
    assert Candidate.from_dict(json.loads(json.dumps(decided.to_dict()))) == decided
