"""Causal regimes of motion, and bounds that hold the label as often as stated."""

from dataclasses import replace

import numpy as np
import pytest

from cylinder_friction.realtime.bounds import (
    CREEP,
    REVERSAL,
    SLIDING,
    STANDSTILL,
    UNKNOWN_N,
    calibrated_bounds,
    causal_velocity,
    creep_below_m_s,
    regimes,
    regimes_of,
    standstill_below_m_s,
    velocity_taps,
)
from cylinder_friction.realtime.model import Bounds
from cylinder_friction.recordings.recording import Recording


@pytest.mark.parametrize(
    ("velocity_mm_s", "expected"),
    [
        ([0.0, 0.9, -0.9], [STANDSTILL] * 3),
        ([0.0, 1.0, 5.0, 5.0, 5.0], [STANDSTILL, REVERSAL, REVERSAL, REVERSAL, CREEP]),
        ([20.0] * 5, [REVERSAL] * 3 + [SLIDING] * 2),
        ([20.0] * 4 + [-20.0] * 4, [REVERSAL] * 3 + [SLIDING] + [REVERSAL] * 3 + [SLIDING]),
        ([20.0] * 4 + [0.0, 0.0, 0.0, 0.0, 20.0], [REVERSAL] * 3 + [SLIDING] + [STANDSTILL] * 4 + [REVERSAL]),
        ([20.0, 0.0, 0.0, 0.0], [REVERSAL] * 3 + [STANDSTILL]),
        ([20.0, 20.0, -20.0, -20.0, -20.0, -15.9], [REVERSAL] * 5 + [CREEP]),
    ],
)
def test_regime_follows_velocity(velocity_mm_s: list[float], expected: list[int]) -> None:
    got = regimes(1e-3 * np.array(velocity_mm_s), 1e-3, 16e-3, 3)
    assert list(got) == expected


def labelled(recording: Recording, friction_n: np.ndarray, usable: np.ndarray | None = None) -> Recording:
    usable = np.ones(len(recording), dtype=bool) if usable is None else usable
    return recording.with_columns(friction_n=friction_n, usable=usable)


def bounds_of(recordings: list[Recording], warm_up_samples: int = 0, probability: float = 0.9) -> Bounds:
    """Return the bounds of an estimate of 0, whose error is the label."""
    estimates_n = [np.zeros(len(recording)) for recording in recordings]
    return calibrated_bounds(recordings, estimates_n, 0.005, warm_up_samples, probability)


def test_half_of_the_misses_lie_on_either_side_within_every_regime(labelled_recordings: list[Recording]) -> None:
    generator = np.random.default_rng(0)
    recordings = []
    standstill_m_s = standstill_below_m_s(labelled_recordings)
    creep_m_s = creep_below_m_s([causal_velocity(recording) for recording in labelled_recordings], standstill_m_s)
    regime_of = {each.name: regimes_of(each, standstill_m_s, creep_m_s) for each in labelled_recordings}
    for recording in labelled_recordings:
        regime = regime_of[recording.name]
        recordings.append(labelled(recording, (1.0 + regime) * generator.normal(size=len(recording))))
    bounds = bounds_of(recordings, probability=0.8)
    assert (bounds.standstill_m_s, bounds.creep_m_s) == (standstill_m_s, creep_m_s)
    for one in (CREEP, SLIDING, REVERSAL):
        errors = np.concatenate([each.column("friction_n")[regime_of[each.name] == one] for each in recordings])
        assert np.mean(errors < bounds.lower_n[one]) == pytest.approx(0.1, abs=1.0 / len(errors) + 1e-3)
        assert np.mean(errors > bounds.upper_n[one]) == pytest.approx(0.1, abs=1.0 / len(errors) + 1e-3)
    assert bounds.upper_n[SLIDING] > bounds.upper_n[CREEP]


def test_creep_is_the_slowest_two_fifths_of_motion() -> None:
    velocity_m_s = np.array([0.0, 1e-4, -0.01, 0.02, 0.03, -0.04, 0.05, 0.06])
    assert creep_below_m_s([velocity_m_s[:3], velocity_m_s[3:]], 1e-3) == pytest.approx(0.03)
    assert creep_below_m_s([10.0 * velocity_m_s], 1e-3) == pytest.approx(0.3)
    assert creep_below_m_s([np.zeros(4)], 1e-3) == 1e-3


def test_standstill_is_as_fast_as_the_noise_of_the_velocity(labelled_recordings: list[Recording]) -> None:
    """Of another sensor, ten times as noisy, it is ten times as fast."""
    recording = labelled_recordings[0]
    noise_m = np.random.default_rng(0).normal(0.0, 1e-4, len(recording))
    gain = np.linalg.norm(velocity_taps(recording.sample_time_s))
    for times in (1.0, 10.0):
        noisy = recording.with_columns(position_m=times * noise_m)
        assert standstill_below_m_s([noisy]) == pytest.approx(times * 1e-4 * gain, rel=0.2)
    assert standstill_below_m_s([]) == 0.0


def test_the_finite_sample_quantile_is_taken(labelled_recordings: list[Recording]) -> None:
    recording = labelled_recordings[0]
    regime = regimes_of(recording, 1e-3, creep_below_m_s([causal_velocity(recording)], 1e-3))
    rows = np.flatnonzero(regime == SLIDING)[:39]
    friction = np.zeros(len(recording))
    friction[rows] = np.arange(1.0, 40.0)
    usable = np.zeros(len(recording), dtype=bool)
    usable[rows] = True
    bounds = bounds_of([labelled(recording, friction, usable)])
    assert (bounds.lower_n[SLIDING], bounds.upper_n[SLIDING]) == (2.0, 38.0)  # ranks 2 and 38: 40 · 0.95 of 39
    assert bounds.lower_n[CREEP] == bounds.lower_n[SLIDING]  # a regime without rows takes the errors of all


def test_few_sessions_that_differ_widen_the_bounds(labelled_recordings: list[Recording]) -> None:
    """The same errors, of 10 N up in one recording and down in the other: of one session, and of two."""
    generator, parts = np.random.default_rng(2), []
    for place, recording in enumerate(labelled_recordings[:2]):
        errors_n = generator.normal(10.0 * (-1.0) ** place, 1.0, len(recording))
        parts.append(labelled(recording, errors_n))
    together = [replace(each, metadata=replace(each.metadata, session="one")) for each in parts]
    one, two = bounds_of(together), bounds_of(parts)
    ratio = np.array(two.upper_n) / np.array(one.upper_n)
    assert (ratio > 3.0).all()
    np.testing.assert_allclose(np.array(two.lower_n) / np.array(one.lower_n), ratio)


def test_without_enough_rows_bounds_say_nothing(labelled_recordings: list[Recording]) -> None:
    recording = labelled_recordings[0]
    usable = np.arange(len(recording)) < 5
    bounds = bounds_of([labelled(recording, np.zeros(len(recording)), usable)])
    assert bounds.upper_n == (UNKNOWN_N,) * 4


def test_warm_up_rows_do_not_count(labelled_recordings: list[Recording]) -> None:
    friction = np.where(np.arange(len(labelled_recordings[0])) < 600, 1e6, 1.0)
    bounds = bounds_of([labelled(labelled_recordings[0], friction)], warm_up_samples=600)
    assert max(bounds.upper_n) == 1.0


@pytest.mark.parametrize("probability", [0.0, 1.0, float("nan")])
def test_a_probability_that_is_none_is_refused(probability: float) -> None:
    with pytest.raises(ValueError, match=r"probability must be in \(0, 1\), but got"):
        bounds_of([], probability=probability)


def test_stated_uncertainty_widens_the_bounds_to_hold_friction(labelled_recordings: list[Recording]) -> None:
    generator = np.random.default_rng(5)
    offsets_n = 12.0 * generator.normal(size=40)
    labels = [labelled(each, 5.0 * generator.normal(size=len(each))) for each in labelled_recordings]
    stated = [each.with_columns(friction_uncertainty_n=np.full(len(each), 24.0)) for each in labels]
    bare, bounds = bounds_of(labels), bounds_of(stated)
    assert (bare.holds, bounds.holds) == ("label", "friction")
    assert bounds.upper_n[SLIDING] == pytest.approx(1.645 * 13.0, rel=0.03)
    assert bounds.lower_n[SLIDING] == pytest.approx(-1.645 * 13.0, rel=0.03)
    assert bare.upper_n[SLIDING] == pytest.approx(1.645 * 5.0, rel=0.06)
    friction_n = np.concatenate([label.column("friction_n") - offset for label in labels for offset in offsets_n])
    held = (friction_n > bounds.lower_n[SLIDING]) & (friction_n < bounds.upper_n[SLIDING])
    assert held.mean() == pytest.approx(0.9, abs=0.06), "over forty sessions, each with an offset of its own"


def test_one_recording_without_stated_uncertainty_leaves_the_label(labelled_recordings: list[Recording]) -> None:
    first, second = labelled_recordings[:2]
    assert bounds_of([first.with_columns(friction_uncertainty_n=np.ones(len(first))), second]).holds == "label"
