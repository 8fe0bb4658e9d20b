"""The flag fires on what was never taught: a higher pressure, a faster stroke; and not on what was."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from cylinder_friction.evaluation.benchmark.flags import TaughtRange, causal_velocity, offline_velocity

if TYPE_CHECKING:
    from cylinder_friction.recordings import Recording

INPUTS = ("pressure_1_pa", "pressure_2_pa", "position_m")


@pytest.fixture
def known(labelled_recordings: list[Recording]) -> TaughtRange:
    return TaughtRange.of(labelled_recordings, INPUTS, causal_velocity)


def test_what_was_taught_is_inside(known: TaughtRange, labelled_recordings: list[Recording]) -> None:
    assert not any(known.leaves(recording, causal_velocity).any() for recording in labelled_recordings)


def test_a_pressure_never_taught_is_outside_while_it_lasts(
    known: TaughtRange, labelled_recordings: list[Recording]
) -> None:
    recording = labelled_recordings[0]
    pressure = recording.column("pressure_1_pa").copy()
    pressure[100:200] += 1e8
    flagged = known.leaves(recording.with_columns(pressure_1_pa=pressure), causal_velocity)
    np.testing.assert_array_equal(np.flatnonzero(flagged), np.arange(100, 200))


def test_a_speed_never_taught_is_outside_though_every_input_is_inside(labelled_recordings: list[Recording]) -> None:
    slow = labelled_recordings[0]
    known = TaughtRange.of([slow], ("position_m",), causal_velocity)
    position = slow.column("position_m")
    stroke = np.linspace(position.min(), position.max(), 40)
    position = np.concatenate([np.full(500, stroke[0]), stroke, np.full(len(position) - 540, stroke[-1])])
    flagged = known.leaves(slow.with_columns(position_m=position), causal_velocity)
    assert flagged[510:540].all()
    assert not flagged[:500].any()
    assert not flagged[600:].any()


def test_both_velocities_agree_on_a_clean_recording(labelled_recordings: list[Recording]) -> None:
    recording = labelled_recordings[0]
    apart = np.abs(causal_velocity(recording) - offline_velocity(recording))
    assert np.quantile(apart[50:], 0.99) < 5e-3
