"""What the guard lets through, holds and flags: one contract for every sample."""

import numpy as np
import pytest

from cylinder_friction.realtime.flags import Flag
from cylinder_friction.realtime.guard import (
    FREEZE_TRAVEL_M,
    TrainingRange,
    freeze_travel_m,
    guard_from,
    largest_friction_n,
)
from cylinder_friction.realtime.stream import RealTimeStream
from cylinder_friction.recordings.columns import PRESSURES, SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording

SAMPLE = (9e5, 1.0e6, 0.125)
BAD = [float("nan"), float("inf"), -float("inf"), 1e300]


def moved(sample: tuple[float, float, float], **changes: float) -> tuple[float, float, float]:
    names = ("p1", "p2", "x")
    return tuple(value + changes.get(name, 0.0) for name, value in zip(names, sample, strict=True))  # type: ignore


def test_limits_come_from_the_training_range() -> None:
    trained = TrainingRange(SAMPLE_COLUMNS, (0.0, 1e5, -0.01), (1e6, 2e5, 0.19))
    guard = guard_from(trained, 500.0, 0.005)
    assert guard.accept_lower == pytest.approx((-1e6, 0.0, -0.21))
    assert guard.accept_upper == pytest.approx((2e6, 3e5, 0.39))
    assert guard.trained_lower == pytest.approx((-5e4, 9.5e4, -0.02))
    assert guard.trained_upper == pytest.approx((1.05e6, 2.05e5, 0.2))
    assert (guard.freeze_samples, guard.freeze_force_n) == (400, 1000.0)
    assert (guard.warm_up_samples, guard.recovery_samples) == (600, 600)


def test_largest_friction_is_that_of_usable_rows(labelled_recordings: list[Recording]) -> None:
    recording = labelled_recordings[0]
    friction = np.zeros(len(recording))
    friction[[3, 5]] = -700.0, 9e9
    usable = np.arange(len(recording)) != 5
    spoilt = recording.with_columns(friction_n=friction, usable=usable)
    assert largest_friction_n([spoilt, recording.with_columns(usable=np.zeros(len(recording), dtype=bool))]) == 700.0
    assert largest_friction_n([]) == 0.0


def test_a_pressure_may_stay_constant_for_longer_where_its_converter_is_coarse(
    labelled_recordings: list[Recording],
) -> None:
    def rounded(step_pa: float) -> list[Recording]:
        return [
            each.with_columns(**{name: step_pa * np.round(each.column(name) / step_pa) for name in PRESSURES})
            for each in labelled_recordings
        ]

    assert freeze_travel_m(labelled_recordings) == FREEZE_TRAVEL_M
    fine, coarse = freeze_travel_m(rounded(5e4)), freeze_travel_m(rounded(1e5))
    assert FREEZE_TRAVEL_M < fine < coarse
    dead = labelled_recordings[0].with_columns(pressure_1_pa=np.full(len(labelled_recordings[0]), 9e5))
    assert freeze_travel_m([dead, *labelled_recordings[1:]]) == FREEZE_TRAVEL_M, "one sensor that froze changes nothing"


@pytest.mark.parametrize("value", BAD)
@pytest.mark.parametrize("channel", range(3))
def test_a_bad_channel_is_held_at_its_last_valid_value(stream: RealTimeStream, channel: int, value: float) -> None:
    other = RealTimeStream(stream.model)
    for step in range(5):
        sample = moved(SAMPLE, p1=1e4 * step, p2=-1e4 * step, x=1e-4 * step)
        stream.step(*sample)
        other.step(*sample)
    held = list(sample)
    now = list(moved(sample, p1=5e3, p2=5e3, x=1e-4))
    stood_in = now.copy()
    stood_in[channel] = held[channel]
    now[channel] = value
    got, expected = stream.step(*now), other.step(*stood_in)
    assert got[:3] == expected[:3]
    assert got.flags & ~Flag.WARMING == Flag.INVALID_PRESSURE_1 << channel


def test_a_reading_at_the_end_of_the_accepted_range_is_valid_and_the_next_number_is_not(stream: RealTimeStream) -> None:
    guard = stream.model.guard
    stream.step(*SAMPLE)
    for limit, beyond in ((guard.accept_lower[0], -np.inf), (guard.accept_upper[0], np.inf)):
        assert not stream.step(limit, *SAMPLE[1:]).flags & Flag.INVALID_PRESSURE_1
        assert stream.step(np.nextafter(limit, beyond), *SAMPLE[1:]).flags & Flag.INVALID_PRESSURE_1


def test_warming_lasts_as_long_as_it_says(stream: RealTimeStream) -> None:
    steps = stream.model.guard.warm_up_samples
    flags = [stream.step(*moved(SAMPLE, x=1e-6 * step)).flags for step in range(steps + 5)]
    assert flags == [Flag.WARMING] * steps + [0] * 5


def test_recovering_begins_with_the_first_sound_sample_and_lasts_as_long_as_it_says(stream: RealTimeStream) -> None:
    stream.warm_up(*SAMPLE, steps=stream.model.guard.warm_up_samples)
    bad = [stream.step(float("nan"), *SAMPLE[1:]).flags for _ in range(3)]
    steps = stream.model.guard.recovery_samples
    after = [stream.step(*SAMPLE).flags for _ in range(steps + 5)]
    assert bad == [Flag.INVALID_PRESSURE_1] * 3
    assert after == [Flag.RECOVERING] * steps + [0] * 5


@pytest.mark.parametrize("channel", [0, 1])
def test_a_pressure_that_stays_while_the_piston_travels_is_frozen_until_it_changes(
    stream: RealTimeStream, channel: int
) -> None:
    stream.warm_up(*SAMPLE, steps=stream.model.guard.warm_up_samples)
    other = ("p2", "p1")[channel]
    travel = [0.0, 4.9e-3, 5.1e-3, 0.0]
    samples = [moved(SAMPLE, **{other: 1e3 * (1 + step)}, x=x) for step, x in enumerate(travel)]
    assert [stream.step(*sample).flags for sample in samples] == [0, 0, Flag.FROZEN, Flag.FROZEN]
    assert stream.step(*moved(SAMPLE, p1=1e3, p2=1e3)).flags == Flag.RECOVERING


def test_a_held_pressure_is_not_a_frozen_one(stream: RealTimeStream) -> None:
    stream.warm_up(*SAMPLE, steps=stream.model.guard.warm_up_samples)
    for step in range(10):
        got = stream.step(float("nan"), SAMPLE[1] + step, SAMPLE[2] + 2e-3 * step)
        assert got.flags == Flag.INVALID_PRESSURE_1
    assert stream.step(SAMPLE[0], SAMPLE[1], SAMPLE[2] + 2e-2).flags == Flag.RECOVERING
