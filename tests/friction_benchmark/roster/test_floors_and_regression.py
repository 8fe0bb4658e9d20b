"""Floors and regression take part in every task that their inputs allow."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from friction_benchmark.roster import floors, regression
from friction_benchmark.roster.entry import Making, OneOf, Range

if TYPE_CHECKING:
    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.recordings.recording import Recording
    from friction_benchmark.roster.entry import RosterEntry

ENTRIES = {entry.name: entry for entry in (*floors.ENTRIES, *regression.ENTRIES)}
EFFORT = 0.02


@pytest.mark.parametrize("name", ENTRIES)
@pytest.mark.parametrize("inputs", [SAMPLE_COLUMNS, ("position_m",)], ids=["raw", "blind"])
def test_each_can_be_made_and_fitted_where_it_says_so(
    name: str, inputs: tuple[str, ...], cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    entry = ENTRIES[name]
    if not entry.can(inputs):
        assert inputs == ("position_m",)
        assert name in ("low_pass", "hold", "disturbance_observer")
        return
    estimator = entry.make(Making(cylinder, inputs, 0, EFFORT, entry.first))
    assert set(estimator.inputs) <= set(inputs)
    estimator.fit(labelled_recordings)
    assert np.isfinite(estimator.estimate(labelled_recordings[0])).all()


def corners(entry: RosterEntry, high: bool) -> dict[str, float | int | str]:
    found: dict[str, float | int | str] = {}
    for name, allowed in entry.space.items():
        if isinstance(allowed, Range):
            found[name] = allowed.high if high else allowed.low
        elif isinstance(allowed, OneOf):
            found[name] = allowed.values[-1 if high else 0]
    return found


@pytest.mark.parametrize("high", [False, True])
@pytest.mark.parametrize("name", [name for name, entry in ENTRIES.items() if entry.space])
def test_both_ends_of_what_may_be_tuned_can_be_made(name: str, high: bool, cylinder: Cylinder) -> None:
    entry = ENTRIES[name]
    entry.make(Making(cylinder, SAMPLE_COLUMNS, 0, EFFORT, corners(entry, high)))


def test_more_effort_means_more_trees(cylinder: Cylinder) -> None:
    entry = ENTRIES["gradient_boosting"]
    quick, full = (entry.make(Making(cylinder, SAMPLE_COLUMNS, 0, effort, entry.first)) for effort in (0.25, 1.0))
    assert (quick.plan.trees, full.plan.trees) == (100, 400)  # type: ignore[attr-defined]
