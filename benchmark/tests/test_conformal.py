"""Bounds: as wide as errors between sessions are, not as errors within one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from friction_benchmark.conformal import calibrated
from friction_benchmark_models import made_recording

if TYPE_CHECKING:
    from cylinder_friction.recordings.recording import Recording


def sessions(count: int, between_n: float, within_n: float, seed: int) -> tuple[list[Recording], list[np.ndarray]]:
    """Return recordings and estimates whose error has a part of its own in each session."""
    generator = np.random.default_rng(seed)
    recordings = [made_recording("1", session, seed).recording for session in range(1, count + 1)]
    estimates = [
        r.column("friction_n") + between_n * generator.normal() + generator.normal(0.0, within_n, len(r))
        for r in recordings
    ]
    return recordings, estimates


def coverage(between_n: float, within_n: float) -> float:
    inside = []
    for seed in range(6):
        bounds = calibrated(*sessions(12, between_n, within_n, seed))
        for recording, estimate in zip(*sessions(12, between_n, within_n, 100 + seed), strict=True):
            lower, upper = bounds.around(recording, estimate)
            label = recording.column("friction_n")
            inside.append(((label >= lower) & (label <= upper))[recording.usable()])
    return float(np.concatenate(inside).mean())


def test_independent_errors_are_held_as_often_as_asked() -> None:
    assert coverage(0.0, 20.0) == pytest.approx(0.9, abs=0.01)


def test_errors_alike_within_a_session_are_held_nearly_as_often() -> None:
    assert 0.88 <= coverage(20.0, 5.0) <= 0.96


def test_errors_between_sessions_widen_the_bounds() -> None:
    assert calibrated(*sessions(4, 20.0, 2.0, 0)).factor > 1.2
    assert calibrated(*sessions(12, 0.0, 20.0, 0)).factor < 1.05


def test_loads_that_differ_in_level_are_held_alike() -> None:
    """Errors grow with the level of friction, so that one interval for all would hold the lightest load always."""
    generator = np.random.default_rng(3)

    def loaded(first: int) -> tuple[list[Recording], list[np.ndarray]]:
        recordings, estimates = [], []
        for session in range(first, first + 12):
            level = 1.0 + 3.0 * (session % 3)
            recording = made_recording("1", session).recording
            label = level * (300.0 + recording.column("friction_n"))
            recordings.append(recording.with_columns(friction_n=label))
            estimates.append(label + generator.normal(0.0, 10.0 * level, len(label)))
        return recordings, estimates

    bounds = calibrated(*loaded(1))
    shares: dict[int, list[float]] = {}
    for place, (recording, estimate) in enumerate(zip(*loaded(13), strict=True)):
        lower, upper = bounds.around(recording, estimate)
        label = recording.column("friction_n")
        shares.setdefault(place % 3, []).append(float(((label >= lower) & (label <= upper))[recording.usable()].mean()))
    for held in shares.values():
        assert np.mean(held) == pytest.approx(0.9, abs=0.06)


def test_bounds_lie_around_a_biased_estimate_unevenly() -> None:
    recordings, estimates = sessions(6, 0.0, 5.0, 1)
    bounds = calibrated(recordings, [estimate - 50.0 for estimate in estimates])
    lower, upper = bounds.around(recordings[0], estimates[0] - 50.0)
    centre = 0.5 * (lower + upper) - (estimates[0] - 50.0)
    assert centre == pytest.approx(np.full(len(centre), 50.0), abs=3.0)


def test_a_higher_probability_is_wider() -> None:
    pair = sessions(6, 5.0, 5.0, 2)
    narrow, wide = calibrated(*pair, 0.5), calibrated(*pair, 0.9)
    assert ((wide.upper_n - wide.lower_n) > (narrow.upper_n - narrow.lower_n)).all()


def test_nothing_to_calibrate_on_is_refused() -> None:
    recording = made_recording("1", 1).recording
    bare = recording.with_columns(usable=np.zeros(len(recording), dtype=bool))
    with pytest.raises(ValueError, match="none of 1 validation recordings has a usable row"):
        calibrated([bare], [np.zeros(len(bare))])
    with pytest.raises(ValueError, match=r"probability must be in \(0, 1\), but got 1.0"):
        calibrated([recording], [np.zeros(len(recording))], 1.0)
