import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cylinder_friction.signals.motion import event_masks, last_direction, noise_rms, standstill_rows, widened


def velocity(*stretches: tuple[float, int]) -> np.ndarray:
    return np.concatenate([np.full(rows, value) for value, rows in stretches])


@pytest.mark.parametrize(
    ("motion", "expected"),
    [
        (velocity((0.0, 50), (0.1, 50)), {"start": [50]}),
        (velocity((0.1, 50), (0.0, 50)), {"stop": [50]}),
        (velocity((0.1, 50), (-0.1, 50)), {"reversal": [50]}),
        (velocity((0.1, 40), (0.0, 5), (-0.1, 40)), {"reversal": [40, 45]}),
        (velocity((0.1, 40), (0.0, 30), (-0.1, 40)), {"stop": [40], "start": [70]}),
        (velocity((0.1, 40), (0.0, 5), (0.1, 40)), {"stop": [40], "start": [45]}),
        (velocity((0.1, 100)), {}),
        (velocity((5e-4, 50), (-5e-4, 50)), {}),
    ],
)
def test_each_kind_of_event(motion: np.ndarray, expected: dict[str, list[int]]) -> None:
    masks = event_masks(motion, 10)
    for kind, mask in masks.items():
        wanted = np.zeros(len(motion), dtype=bool)
        for row in expected.get(kind, []):
            wanted[max(row - 10, 0) : row + 11] = True
        np.testing.assert_array_equal(mask, wanted)


@given(st.lists(st.booleans(), min_size=1, max_size=60), st.integers(0, 70), st.integers(0, 70))
def test_a_widened_mask_equals_its_definition(mask: list[bool], before: int, after: int) -> None:
    hits = np.flatnonzero(mask)
    expected = [any(hit - before <= row <= hit + after for hit in hits) for row in range(len(mask))]
    np.testing.assert_array_equal(widened(np.array(mask), before, after), expected)


def test_direction_holds_at_standstill() -> None:
    velocity = np.array([0.0, 0.0, -1.0, 0.0, 0.0, 2.0, 0.0])
    np.testing.assert_array_equal(last_direction(velocity), [1, 1, -1, -1, -1, 1, 1])


def test_rest_is_found_between_motions_and_noise_is_about_its_mean() -> None:
    generator = np.random.default_rng(0)
    velocity = np.concatenate([np.zeros(1000), np.full(1000, 0.01), np.zeros(1000)])
    position = np.cumsum(velocity) * 0.005 + generator.normal(0.0, 1e-5, 3000)
    rest = standstill_rows(position, 0.005)
    assert not rest[980:2020].any()
    assert rest[100:800].all()
    assert rest[2200:2900].all()
    assert noise_rms(position, rest) == pytest.approx(1e-5, rel=0.05)
    assert standstill_rows(position, 0.005, around_rows=200).sum() < rest.sum()


def test_nothing_rests_in_a_recording_shorter_than_a_rest() -> None:
    assert not standstill_rows(np.zeros(20), 0.005).any()
    assert np.isnan(noise_rms(np.zeros(20), np.zeros(20, dtype=bool)))
