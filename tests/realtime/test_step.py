"""A step model of every design does what its estimator does."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.forest import ForestEstimator
from cylinder_friction.estimators.hybrid import HybridEstimator, forest_input
from cylinder_friction.estimators.linear import LinearEstimator, LowPassForceBalanceEstimator
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.estimators.lugre import LugreEstimator
from cylinder_friction.realtime.bounds import UNKNOWN_N
from cylinder_friction.realtime.flags import Flag
from cylinder_friction.realtime.stream import RealTimeStream
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.signals.causal import FirFilter
from cylinder_friction.testing.golden import MODEL_FOLDER, read_trajectories, trace
from golden_fixtures import GOLDEN
from model_shapes import predicted


def by_its_parts(estimator: FrictionEstimator, samples: np.ndarray) -> np.ndarray:
    """Friction [N] from the parts that training uses: filters, network and forest, each over all rows."""
    if isinstance(estimator, LinearEstimator):
        return FirFilter(estimator.taps[None]).run(samples)[:, 0] + estimator._constant_n
    if isinstance(estimator, ForestEstimator):
        return predicted(estimator.forest, estimator.front_end.run(samples)[0])
    assert isinstance(estimator, HybridEstimator)
    parts = estimator.parts
    assert parts is not None
    features, base_n = parts.front_end.run(samples)
    hidden, head = parts.network.run(features)
    result = base_n + parts.target_mean_n
    if parts.forest is None or parts.design != "paper":
        result = result + parts.target_scale_n * head.astype(np.float64)
    if parts.forest is None:
        return result
    seen = forest_input(parts.design, hidden, head, features)
    return result + parts.target_scale_n * predicted(parts.forest, seen)


def test_on_valid_samples_the_step_is_the_estimate_bit_for_bit(
    designed: FrictionEstimator, labelled_recordings: list[Recording]
) -> None:
    model, recording = designed.step_model(), labelled_recordings[0]
    samples, expected = recording.samples(designed.inputs)[:800], designed.estimate(recording)[:800]
    newtons, flags = RealTimeStream(model).run(samples)
    np.testing.assert_array_equal(newtons[:, 0], expected)
    assert set(flags) <= {0, Flag.WARMING, Flag.OFFSET_UNKNOWN, Flag.WARMING | Flag.OFFSET_UNKNOWN}


def test_the_step_is_what_was_trained_bit_for_bit(
    designed: FrictionEstimator, labelled_recordings: list[Recording]
) -> None:
    samples = labelled_recordings[0].samples(designed.inputs)[:800]
    newtons, _ = RealTimeStream(replace(designed.step_model(), offset=None)).run(samples)
    np.testing.assert_array_equal(newtons[:, 0], by_its_parts(designed, designed.channels_of(samples)))


INTERPRETED = """
import sys
from pathlib import Path
import numpy as np
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.testing.golden import read_trajectories, trace
folder = Path(sys.argv[1])
model, golden = load_estimator(folder / "model").step_model(), read_trajectories(folder)["bad_samples"]
rows = slice(640, 940)
again = trace(model, golden.samples[rows])
compiled = np.load(sys.argv[2])
print(np.abs(again.newtons - compiled["newtons"]).max(), (again.flags != compiled["flags"]).sum())
"""


@pytest.mark.extended
@pytest.mark.parametrize(
    "folder", [GOLDEN, GOLDEN / "learns_offset", GOLDEN / "pressure_free"], ids=lambda each: each.name
)
def test_without_its_compiler_the_step_gives_the_same(folder: Path, tmp_path: Path) -> None:
    """Plain Python checks every index and rounds as NumPy does."""
    golden = read_trajectories(folder)["bad_samples"]
    compiled = trace(load_estimator(folder / MODEL_FOLDER).step_model(), golden.samples[640:940])
    np.savez(tmp_path / "compiled.npz", newtons=compiled.newtons, flags=compiled.flags)
    done = subprocess.run(
        [sys.executable, "-c", INTERPRETED, str(folder), str(tmp_path / "compiled.npz")],
        env=os.environ | {"NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    difference_n, other_flags = map(float, done.stdout.split())
    assert difference_n < 1e-9
    assert other_flags == 0


def test_an_estimator_that_was_never_calibrated_says_nothing_about_its_error(
    cylinder: Cylinder, small_hybrid: HybridEstimator
) -> None:
    alone = small_hybrid.without_forest()
    assert alone.guard == small_hybrid.guard
    assert alone.bounds is None
    bounds = alone.step_model().bounds
    assert (bounds.lower_n, bounds.upper_n, bounds.probability) == ((-UNKNOWN_N,) * 4, (UNKNOWN_N,) * 4, 1.0)
    assert "as wide as can be, as this model's errors were never calibrated" in bounds.in_words()


def test_an_estimator_without_a_real_time_step_is_refused(cylinder: Cylinder) -> None:
    with pytest.raises(ValueError, match="lugre: has no real-time step; expected a hybrid, forest, force balance or"):
        LugreEstimator(cylinder).step_model()


@pytest.mark.parametrize("weight", [1.0, 0.3, 0.02])
def test_the_low_pass_is_a_filter_cut_where_the_rest_no_longer_counts(
    weight: float, cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    low_pass = LowPassForceBalanceEstimator(cylinder).fit(labelled_recordings)
    low_pass.weight = weight
    recording = labelled_recordings[0]
    newtons, _ = low_pass.real_time().run(recording.samples())
    np.testing.assert_allclose(newtons[:, 0], low_pass.estimate(recording), atol=1e-6)
