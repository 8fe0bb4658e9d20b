"""One suite over every causal chain: what it must share with a filter that runs beside a machine."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylinder_friction.signals.causal import CausalBlock
from cylinder_friction.signals.causal_chain import MovingAverage, OneSidedSavitzkyGolay
from cylinder_friction.signals.rts import RtsSmoother
from cylinder_friction.signals.zero_phase import SavitzkyGolay

STEP_S = 0.005
CHAINS = [MovingAverage(), OneSidedSavitzkyGolay(), SavitzkyGolay().causal(), RtsSmoother().causal()]
SAMPLES = np.random.default_rng(3).normal(size=(300, 3)) * [1e5, 1e5, 1e-3]


@pytest.fixture(params=CHAINS, ids=lambda chain: type(chain).__name__)
def block(request: pytest.FixtureRequest) -> CausalBlock:
    return request.param.block(STEP_S)


def outputs(block: CausalBlock, samples: np.ndarray) -> np.ndarray:
    return block.advance(block.new_state(), samples)


def test_future_changes_nothing(block: CausalBlock) -> None:
    changed = SAMPLES.copy()
    changed[200:] = 1e9
    np.testing.assert_array_equal(outputs(block, changed)[:200], outputs(block, SAMPLES)[:200])
    assert (outputs(block, changed)[200:] != outputs(block, SAMPLES)[200:]).any()


@settings(max_examples=20, deadline=None)
@given(cuts=st.lists(st.integers(0, 300), max_size=6))
@pytest.mark.parametrize("chain", CHAINS, ids=lambda chain: type(chain).__name__)
def test_cutting_the_input_changes_no_bit(chain: MovingAverage, cuts: list[int]) -> None:
    block = chain.block(STEP_S)
    state = block.new_state()
    pieces = np.split(SAMPLES, sorted(cuts))
    np.testing.assert_array_equal(
        np.concatenate([block.advance(state, piece) for piece in pieces]), outputs(block, SAMPLES)
    )


def test_standstill_is_seen_from_the_first_sample(block: CausalBlock) -> None:
    still = np.tile([3e5, 9e5, 0.1], (50, 1))
    expected = np.tile([3e5, 9e5, 0.0, 0.0], (50, 1))
    np.testing.assert_allclose(outputs(block, still), expected, rtol=1e-12, atol=1e-9)


def test_constant_velocity_is_found(block: CausalBlock) -> None:
    time_s = STEP_S * np.arange(400)
    last = outputs(block, np.column_stack([0.0 * time_s, 0.0 * time_s, 0.03 * time_s]))[-1]
    assert last[2] == pytest.approx(0.03, rel=1e-6)
    assert last[3] == pytest.approx(0.0, abs=1e-6)


def test_paper_chain_is_what_the_paper_says() -> None:
    def average(values: np.ndarray, window: int) -> np.ndarray:
        padded = np.concatenate([np.full(window - 1, values[0]), values])
        return np.lib.stride_tricks.sliding_window_view(padded, window).mean(axis=1)

    position = SAMPLES[:, 2]
    velocity = np.diff(average(position, 10), prepend=position[0]) / STEP_S
    acceleration = average(np.diff(velocity, prepend=0.0) / STEP_S, 30)
    signals = MovingAverage().smooth(SAMPLES, STEP_S)
    np.testing.assert_allclose(signals.pressure_1_smooth_pa, average(SAMPLES[:, 0], 10), rtol=1e-9, atol=1e-6)
    np.testing.assert_allclose(signals.velocity_m_s, velocity, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(signals.acceleration_m_s2, acceleration, rtol=1e-9, atol=1e-9)
