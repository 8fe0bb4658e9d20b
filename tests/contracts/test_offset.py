"""Every runtime learns the offset of the sensors' zeros as Python does, from whatever is known of it before."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contracts.runtimes import Runtime, Stream, all_runtimes
from cylinder_friction.realtime.flags import Flag
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.realtime.stream import RealTimeStream
from golden_fixtures import golden_model
from learned_offset import PRIOR_N, doubting, learning, offset_samples

__all__ = ["golden_model", "offset_samples"]

CLOSE_N = {"c_float": 0.5}
"""Of newtons and offsets, where it is not 0.001: no forest is between them and the samples."""
Outputs = tuple[np.ndarray, np.ndarray, np.ndarray]


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> Callable[[Runtime, Callable[..., StepModel]], Path]:
    """Return the folder of a runtime and a model, so that what it builds is built once."""
    made: dict[tuple[str, str], Path] = {}
    return lambda runtime, kind: made.setdefault((runtime.name, kind.__name__), tmp_path_factory.mktemp("offset"))


def learned(stream: Stream, samples: np.ndarray, *start: float | None) -> Outputs:
    """Return newtons, flags and offsets."""
    stream.reset(*start)
    rows = np.array([(*stream.step(*sample), *stream.offset) for sample in samples.tolist()])
    return rows[:, :3], rows[:, 3].astype(int), rows[:, 4:]


@pytest.mark.parametrize(
    ("kind", "start"),
    [*((learning, start) for start in ((0.0, None), (25.0, 5.0), (-60.0, None), (3.0, 0.0))), (doubting, (0.0, None))],
)
@pytest.mark.parametrize("runtime", all_runtimes(), ids=lambda runtime: runtime.name)
def test_it_learns_what_python_does(
    runtime: Runtime,
    kind: Callable[[StepModel], StepModel],
    start: tuple[float, float | None],
    folders: Callable[..., Path],
    golden_model: StepModel,
    offset_samples: np.ndarray,
) -> None:
    model = replace(kind(golden_model), forest=None, forest_sees="nothing")
    samples = offset_samples[:4000] if kind is learning else offset_samples
    python = RealTimeStream(model)
    python.reset(*start)
    newtons, offsets, flags = python.run_with_offset(samples)
    got = learned(runtime.open(model, folders(runtime, kind)), samples, *start)
    np.testing.assert_array_equal(got[1], flags)
    close_n = CLOSE_N.get(runtime.name, 1e-3)
    np.testing.assert_allclose(got[0], newtons, rtol=0.0, atol=close_n)
    np.testing.assert_allclose(got[2], offsets, rtol=0.0, atol=close_n)
    unknown = flags & Flag.OFFSET_UNKNOWN != 0
    assert unknown[1] == (start[1] is None)
    if kind is learning:
        assert not unknown[2000:].any()
        assert start != (0.0, None) or abs(offsets[-1, 0] - 99.9) < 3.0 * offsets[-1, 1] < 40.0
        assert len(np.unique(offsets[:, 0])) > 50, "the blocks of many strokes"
    else:  # friction is not that of training at times, and zeros are left alone then
        doubted = offsets[:, 0] == 0.0
        assert 0.05 < doubted[1000:].mean() < 0.95
        np.testing.assert_allclose(offsets[doubted, 1], np.hypot(PRIOR_N, 2.5), rtol=1e-4)
        assert unknown[1:][doubted[:-1]].all()
