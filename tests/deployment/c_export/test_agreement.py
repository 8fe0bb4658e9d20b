"""The C gives Python's numbers, whatever the model's shape and whatever comes in."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.deployment.c_export.compiled import CompiledEstimator
from cylinder_friction.deployment.c_export.export import export_c, export_model
from cylinder_friction.estimators.lugre import LugreEstimator, PressureLugreEstimator
from cylinder_friction.realtime.flags import Flag
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.realtime.stream import RealTimeStream
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording
from deployment.c_export.conftest import SHAPES
from learned_offset import PRIOR_N, doubting, learning

DOUBLE_N = 1e-9
FLOAT_N = 0.5


@pytest.mark.parametrize("shape", sorted(SHAPES))
def test_double_is_python(
    shape: str,
    compiled: Callable[..., CompiledEstimator],
    golden_model: StepModel,
    trajectories: dict[str, np.ndarray],
) -> None:
    names = ("bad_samples", "frozen", "stick_slip_reversals")
    samples = np.concatenate([trajectories[name][:900] for name in names])
    expected, expected_flags = RealTimeStream(SHAPES[shape](golden_model)).run(samples)
    newtons, flags = compiled(shape).stream().run(samples)
    np.testing.assert_array_equal(flags, expected_flags)
    np.testing.assert_allclose(newtons, expected, rtol=0.0, atol=DOUBLE_N)


@pytest.mark.parametrize(("precision", "allowed_n"), [("double", DOUBLE_N), ("float", FLOAT_N)])
def test_the_offset_that_is_learned_is_pythons(
    precision: str,
    allowed_n: float,
    compiled: Callable[..., CompiledEstimator],
    golden_model: StepModel,
    offset_samples: np.ndarray,
) -> None:
    python, stream = RealTimeStream(learning(golden_model)), compiled("learning", precision).stream()
    expected, offsets = [], []
    for sample in offset_samples:
        expected.append(python.step(*sample))
        got = stream.step(*sample)
        assert got.flags == expected[-1].flags
        assert got[:3] == pytest.approx(expected[-1][:3], rel=0.0, abs=allowed_n)
        offsets.append(stream.offset)
    assert stream.offset == pytest.approx(python.offset, rel=0.0, abs=allowed_n)
    unknown = np.array([bool(estimate.flags & Flag.OFFSET_UNKNOWN) for estimate in expected])
    assert unknown[1:100].all()
    assert not unknown[1000:].any()
    assert offsets[0] == pytest.approx((0.0, np.hypot(PRIOR_N, 2.5)), rel=1e-5)
    assert abs(offsets[-1][0] - 99.9) < 2.0 * offsets[-1][1] < 20.0


def test_c_leaves_zeros_alone_while_friction_is_not_that_of_training(
    golden_model: StepModel, offset_samples: np.ndarray, tmp_path: Path
) -> None:
    python = RealTimeStream(doubting(golden_model))
    stream = CompiledEstimator(export_model(python.model, tmp_path)).stream()
    doubted = []
    for sample in offset_samples:
        expected, got = python.step(*sample), stream.step(*sample)
        assert got.flags == expected.flags
        assert got[:3] == pytest.approx(expected[:3], rel=0.0, abs=DOUBLE_N)
        assert stream.offset == pytest.approx(python.offset, rel=0.0, abs=DOUBLE_N)
        doubted.append(stream.offset[0] == 0.0)
    assert 0.05 < np.mean(doubted[1000:]) < 0.95


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
    newtons, _ = CompiledEstimator(export_c(estimator, tmp_path)).stream().run(warm[0].samples(inputs))
    np.testing.assert_allclose(newtons[:, 0], estimator.estimate(warm[0]), rtol=0.0, atol=1e-6)


@pytest.mark.extended
def test_an_hour_agrees(
    compiled: Callable[..., CompiledEstimator], golden_model: StepModel, trajectories: dict[str, np.ndarray]
) -> None:
    once = np.concatenate([trajectories[name] for name in sorted(trajectories)])
    hour = np.tile(once, (-(-720_000 // len(once)), 1))[:720_000]
    expected, expected_flags = RealTimeStream(golden_model).run(hour)
    newtons, flags = compiled("whole").stream().run(hour)
    np.testing.assert_array_equal(flags, expected_flags)
    np.testing.assert_allclose(newtons, expected, rtol=0.0, atol=DOUBLE_N)
