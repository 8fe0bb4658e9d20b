"""What the twin teaches: true friction, of rigs that differ from each other and are the same next time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from friction_benchmark.models.learned_gain import LearnedGainEstimator
from friction_benchmark.registry.learned_gain import MODELS
from friction_benchmark.registry.model import BuildConfiguration
from friction_benchmark.twin import TwinPlan, teaching_recordings

if TYPE_CHECKING:
    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.recordings.recording import Recording
    from friction_benchmark.campaigns import LabelledRecording
    from friction_benchmark.registry.model import RegisteredModel

PLAN = TwinPlan(seed=3, rigs=2, duration_s=10.0)


@pytest.fixture(scope="module")
def taught(cylinder: Cylinder) -> tuple[LabelledRecording, ...]:
    return teaching_recordings(PLAN, cylinder)


def test_the_target_is_true_friction(taught: tuple[LabelledRecording, ...]) -> None:
    for labelled in taught:
        assert_array_equal(labelled.recording.column("friction_n"), labelled.true_friction_n)
        assert labelled.recording.usable().any()


def test_every_rig_has_its_own_names_and_sessions(taught: tuple[LabelledRecording, ...]) -> None:
    names = [labelled.recording.name for labelled in taught]
    assert names == sorted(set(names))
    assert len(names) == 2 * 4 * 2
    assert {labelled.recording.metadata.session.split("_")[0] for labelled in taught} == {"rig000", "rig001"}


def test_rigs_differ(taught: tuple[LabelledRecording, ...]) -> None:
    first, second = (
        np.mean([np.abs(one.true_friction_n).mean() for one in taught if one.recording.name.startswith(rig)])
        for rig in ("rig000", "rig001")
    )
    assert abs(first - second) > 20.0


def test_fewer_rigs_are_the_first_of_more_and_the_same_bits(
    taught: tuple[LabelledRecording, ...], cylinder: Cylinder
) -> None:
    again = teaching_recordings(TwinPlan(seed=3, rigs=1, duration_s=10.0), cylinder)
    for one, other in zip(again, taught, strict=False):
        assert one.recording.name == other.recording.name
        assert_array_equal(one.recording.samples(), other.recording.samples())


@pytest.mark.parametrize(
    ("seed", "rigs", "words"), [(0, 0, "rigs must be 1 to 1000"), (0, 1001, "got 1001"), (-1, 1, "seed must be")]
)
def test_a_plan_out_of_range_is_refused(seed: int, rigs: int, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        TwinPlan(seed, rigs)


@pytest.mark.parametrize("entry", MODELS, ids=lambda entry: entry.name)
def test_every_participant_is_made_and_learns(
    entry: RegisteredModel, cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    assert not entry.supports(("position_m",))
    estimator = entry.build(BuildConfiguration(cylinder, SAMPLE_COLUMNS, 1, 0.02, entry.defaults))
    assert isinstance(estimator, LearnedGainEstimator)
    estimator.fit(labelled_recordings[:4])
    assert np.isfinite(estimator.estimate(labelled_recordings[5])).all()
