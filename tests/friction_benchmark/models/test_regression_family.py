"""What the floors, ridge, NARX, boosted trees, LuGre with a residual and the observer share, on any sensors."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np
import pytest

from cylinder_friction.estimators.linear import ForceBalanceEstimator, LowPassForceBalanceEstimator, RidgeEstimator
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording
from friction_benchmark.models.by_direction import ConstantByDirectionEstimator, CoulombViscousLineEstimator
from friction_benchmark.models.disturbance_observer import DisturbanceObserver
from friction_benchmark.models.gradient_boosting import BoostingPlan, GradientBoostingEstimator
from friction_benchmark.models.lugre_residual import LugreResidualEstimator
from friction_benchmark.models.narx import NarxEstimator

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.estimators.base import FrictionEstimator
    from cylinder_friction.recordings.recording import Recording

RAW = SAMPLE_COLUMNS
WARM = (*SAMPLE_COLUMNS, "oil_temperature_c")
BLIND = ("position_m", "oil_temperature_c")
LEVEL = ("position_m", "oil_temperature_c", "pressure_1_level_pa", "pressure_2_level_pa")
PLAN = BoostingPlan(trees=6, leaves=8, rows=2000)

MAKERS: dict[str, Callable[[Cylinder, tuple[str, ...]], FrictionEstimator]] = {
    "hold": lambda cylinder, inputs: ForceBalanceEstimator(cylinder, "none", inputs),
    "low_pass": lambda cylinder, inputs: LowPassForceBalanceEstimator(cylinder, inputs=inputs),
    "constant_by_direction": lambda cylinder, inputs: ConstantByDirectionEstimator(inputs),
    "coulomb_viscous_line": lambda cylinder, inputs: CoulombViscousLineEstimator(inputs),
    "ridge": lambda cylinder, inputs: RidgeEstimator(8, 1.0, inputs),
    "narx": lambda cylinder, inputs: NarxEstimator(cylinder, inputs, terms=20, rows=3000),
    "gradient_boosting": lambda cylinder, inputs: GradientBoostingEstimator(cylinder, inputs, PLAN),
    "lugre_residual": lambda cylinder, inputs: LugreResidualEstimator(
        cylinder, inputs, PLAN, passive_above_m_s=0.01, identification_effort=0.01, identified_on=2
    ),
    "disturbance_observer": lambda cylinder, inputs: DisturbanceObserver(cylinder, inputs, 4, 2),
}
NEED_PRESSURES = ("hold", "low_pass", "disturbance_observer")
CASES = [
    (name, inputs)
    for name, inputs in itertools.product(MAKERS, (RAW, WARM, BLIND, LEVEL))
    if inputs in (RAW, WARM) or name not in NEED_PRESSURES
]


@pytest.fixture(scope="module")
def recordings(labelled_recordings: list[Recording]) -> list[Recording]:
    """The labelled recordings with a temperature, and pressures behind a slow average, beside them."""
    made = []
    for number, recording in enumerate(labelled_recordings):
        levels = {
            f"pressure_{side}_level_pa": np.full(len(recording), recording.column(f"pressure_{side}_pa").mean())
            for side in (1, 2)
        }
        temperature_c = 30.0 + number + 0.01 * recording.column("time_s")
        made.append(recording.with_columns(oil_temperature_c=temperature_c, **levels))
    return made


@pytest.fixture(scope="module", params=CASES, ids=lambda case: f"{case[0]}-{len(case[1])}")
def fitted(
    request: pytest.FixtureRequest, cylinder: Cylinder, recordings: list[Recording]
) -> tuple[FrictionEstimator, Callable[[], FrictionEstimator]]:
    name, inputs = request.param

    def make() -> FrictionEstimator:
        estimator = MAKERS[name](cylinder, inputs)
        estimator.fit(recordings)
        return estimator

    return make(), make


def error_n(estimator: FrictionEstimator, recordings: list[Recording]) -> float:
    return float(np.mean([np.abs(estimator.estimate(r) - r.column("friction_n")).mean() for r in recordings]))


def test_it_gives_finite_newtons_that_are_better_than_nought(
    fitted: tuple[FrictionEstimator, Callable[[], FrictionEstimator]], recordings: list[Recording]
) -> None:
    estimator = fitted[0]
    estimate = estimator.estimate(recordings[3])
    assert estimate.shape == (len(recordings[3]),)
    assert np.isfinite(estimate).all()
    nought = float(np.mean([np.abs(recording.column("friction_n")).mean() for recording in recordings]))
    assert error_n(estimator, recordings) < (1.0 if estimator.kind == "ridge" else 0.6) * nought


def test_the_future_never_changes_the_past(
    fitted: tuple[FrictionEstimator, Callable[[], FrictionEstimator]], recordings: list[Recording]
) -> None:
    estimator = fitted[0]
    samples = recordings[0].samples(estimator.inputs)[:600]
    changed = samples.copy()
    changed[350:] *= 1.3
    before = estimator.advance(estimator.new_state(), samples)[:350]
    np.testing.assert_array_equal(estimator.advance(estimator.new_state(), changed)[:350], before)


def test_cutting_the_input_changes_no_bit_and_nor_does_streaming(
    fitted: tuple[FrictionEstimator, Callable[[], FrictionEstimator]], recordings: list[Recording]
) -> None:
    estimator = fitted[0]
    samples = recordings[0].samples(estimator.inputs)[:500]
    whole = estimator.advance(estimator.new_state(), samples)
    state = estimator.new_state()
    edges = (0, 1, 2, 90, 90, 333, 500)
    pieces = [estimator.advance(state, samples[start:end]) for start, end in itertools.pairwise(edges)]
    np.testing.assert_array_equal(np.concatenate(pieces), whole)
    stream = estimator.stream()
    np.testing.assert_array_equal([stream.step(*sample) for sample in samples[:120]], whole[:120])


def test_save_and_load_round_trip(
    fitted: tuple[FrictionEstimator, Callable[[], FrictionEstimator]], recordings: list[Recording], tmp_path: Path
) -> None:
    estimator = fitted[0]
    estimator.save(tmp_path)
    loaded = load_estimator(tmp_path)
    assert loaded.inputs == estimator.inputs
    assert loaded.multiply_adds() == estimator.multiply_adds() > 0
    np.testing.assert_array_equal(loaded.estimate(recordings[2]), estimator.estimate(recordings[2]))
    assert {path.suffix for path in tmp_path.iterdir()} <= {".json", ".onnx"}


def test_the_same_seed_gives_the_same_bytes(
    fitted: tuple[FrictionEstimator, Callable[[], FrictionEstimator]], tmp_path: Path
) -> None:
    first, make = fitted
    first.save(tmp_path / "first")
    make().save(tmp_path / "second")
    for file in (tmp_path / "first").iterdir():
        assert file.read_bytes() == (tmp_path / "second" / file.name).read_bytes()


@pytest.mark.parametrize("name", NEED_PRESSURES)
def test_what_needs_raw_pressures_says_so(name: str, cylinder: Cylinder, recordings: list[Recording]) -> None:
    with pytest.raises(ValueError, match="expected pressure_1_pa, pressure_2_pa, position_m among the inputs, but got"):
        MAKERS[name](cylinder, ("position_m",)).fit(recordings)


def test_the_order_of_the_inputs_does_not_matter_to_the_force_balance(
    cylinder: Cylinder, recordings: list[Recording]
) -> None:
    plain, turned = (
        LowPassForceBalanceEstimator(cylinder, inputs=inputs)
        for inputs in (RAW, ("oil_temperature_c", "position_m", "pressure_2_pa", "pressure_1_pa"))
    )
    plain.fit(recordings)
    turned.fit(recordings)
    np.testing.assert_allclose(turned.estimate(recordings[0]), plain.estimate(recordings[0]), rtol=1e-12)
