"""What a registration came to survives its file."""

from __future__ import annotations

import json
from dataclasses import asdict

import pytest

from cylinder_friction.tracking.candidate import Candidate, Incumbent, Registered
from cylinder_friction.tracking.versions import Origin

CANDIDATE = Candidate(
    "friction-estimator",
    "models/hybrid",
    "ab" * 32,
    {"1": 2.0, "2": 1.5},
    "cd" * 16,
    Origin({"data/raw/rig": "ef.dir"}, "data/raw/rig", {"train": {"layers": 2}}),
    {"pressure_1_pa": [1e6], "pressure_2_pa": [9e5], "position_m": [0.12]},
)


@pytest.mark.parametrize("incumbent", [None, Incumbent("12" * 32, {"1": 2.5, "2": 1.5})])
def test_a_registration_comes_back_from_its_file(incumbent: Incumbent | None) -> None:
    registered = Registered(CANDIDATE, "champion", True, "promoted: better", 0.1, incumbent)
    assert Registered.from_dict(json.loads(json.dumps(asdict(registered)))) == registered
