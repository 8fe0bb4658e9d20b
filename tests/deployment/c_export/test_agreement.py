"""The C gives Python's numbers, whatever the model's shape and whatever comes in."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.deployment.c_export.compiled import CompiledEstimator
from cylinder_friction.deployment.c_export.export import Precision, export_c, export_model, part_of
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.lugre import LugreEstimator, PressureLugreEstimator
from cylinder_friction.estimators.training_plan import TrainingPlan
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.realtime.stream import RealTimeStream
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording
from learned_offset import learning
from model_shapes import SHAPES

DOUBLE_N = 1e-9


@pytest.mark.parametrize("shape", sorted(SHAPES))
def test_double_is_python(
    shape: str, compiled: Callable[..., CompiledEstimator], golden_model: StepModel, trajectories: dict[str, np.ndarray]
) -> None:
    names = ("bad_samples", "frozen", "stick_slip_reversals")
    samples = np.concatenate([trajectories[name][:900] for name in names])
    expected, expected_flags = RealTimeStream(SHAPES[shape](golden_model)).run(samples)
    newtons, flags = compiled(shape).stream().run(samples)
    np.testing.assert_array_equal(flags, expected_flags)
    np.testing.assert_allclose(newtons, expected, rtol=0.0, atol=DOUBLE_N)


def assert_float_is_double_rounded(double: CompiledEstimator, single: CompiledEstimator, samples: np.ndarray) -> None:
    """Equal samples make equal estimates: no comparison may fall otherwise for the precision alone."""
    fed = samples.astype(np.float32).astype(np.float64)
    (expected, expected_flags), (newtons, flags) = double.stream().run(fed), single.stream().run(fed)
    np.testing.assert_array_equal(newtons, expected.astype(np.float32))
    np.testing.assert_array_equal(flags, expected_flags)


@pytest.mark.parametrize("shape", ["whole", "learning"])
def test_float_is_double_rounded(
    shape: str, compiled: Callable[..., CompiledEstimator], trajectories: dict[str, np.ndarray]
) -> None:
    samples = np.concatenate([trajectories["stick_slip_reversals"], trajectories["bad_samples"]])
    assert_float_is_double_rounded(compiled(shape), compiled(shape, "float"), samples)


def test_float_is_double_rounded_on_positions_in_steps_for_an_adapted_model(
    small_hybrid: HybridEstimator, labelled_recordings: list[Recording], tmp_path: Path
) -> None:
    press = Cylinder(bore_diameter_m=0.08, rod_diameter_m=0.045, stroke_m=0.25, moving_mass_kg=6.0)
    stepped = [
        each.with_columns(position_m=1e-4 * np.round(each.column("position_m") / 1e-4)) for each in labelled_recordings
    ]
    adapted = small_hybrid.adapt(stepped[:3], press, plan=TrainingPlan(1, None, 200, 20, 4))
    double, single = (
        CompiledEstimator(export_c(adapted, tmp_path / precision, precision=precision))
        for precision in get_args(Precision)
    )
    samples = np.concatenate([each.samples(adapted.inputs) for each in stepped])
    assert_float_is_double_rounded(double, single, samples)


@pytest.mark.parametrize(("settling", "block"), [(0, 1), (7, 3), (3, 7), (0, 150)])
@pytest.mark.extended
def test_it_learns_the_offset_whatever_makes_a_block(
    settling: int, block: int, golden_model: StepModel, offset_samples: np.ndarray, tmp_path: Path
) -> None:
    model, samples = part_of(learning(golden_model), "base"), offset_samples[:2000]
    assert model.offset is not None
    settings = model.offset.settings._replace(settling=settling, block=block)
    model = replace(model, offset=model.offset._replace(settings=settings))
    newtons, offsets, flags = RealTimeStream(model).run_with_offset(samples)
    stream = CompiledEstimator(export_model(model, tmp_path)).stream()
    rows = np.array([(*stream.step(*sample), *stream.offset) for sample in samples.tolist()])
    np.testing.assert_array_equal(rows[:, 3], flags)
    np.testing.assert_allclose(rows[:, :3], newtons, rtol=0.0, atol=DOUBLE_N)
    np.testing.assert_allclose(rows[:, 4:], offsets, rtol=0.0, atol=DOUBLE_N)
    assert len(np.unique(offsets[:, 0])) > 1


@pytest.mark.parametrize("kind", [LugreEstimator, PressureLugreEstimator])
@pytest.mark.parametrize(
    "inputs",
    [SAMPLE_COLUMNS, ("position_m", "oil_temperature_c", "pressure_2_pa", "pressure_1_pa")],
    ids=["usual_inputs", "other_order"],
)
def test_lugre_streams_what_it_estimates(
    kind: type[LugreEstimator],
    inputs: tuple[str, ...],
    cylinder: Cylinder,
    labelled_recordings: list[Recording],
    tmp_path: Path,
) -> None:
    warm = [each.with_columns(oil_temperature_c=30.0 + each.column("time_s")) for each in labelled_recordings]
    estimator = kind(cylinder, population=4, generations=2, simulated_recordings=1, inputs=inputs)
    estimator.fit(warm)
    double, single = (
        CompiledEstimator(export_c(estimator, tmp_path / precision, precision=precision))
        for precision in get_args(Precision)
    )
    newtons, _ = double.stream().run(warm[0].samples(inputs))
    np.testing.assert_allclose(newtons[:, 0], estimator.estimate(warm[0]), rtol=0.0, atol=1e-6)
    assert_float_is_double_rounded(double, single, warm[0].samples(inputs))
