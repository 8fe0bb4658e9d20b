import numpy as np

from cylinder_friction.signals.causal_chain import MovingAverage

STEP_S = 0.005
SAMPLES = np.random.default_rng(3).normal(size=(300, 3)) * [1e5, 1e5, 1e-3]


def test_future_changes_nothing() -> None:
    changed = SAMPLES.copy()
    changed[200:] = 1e9
    for now, then in zip(
        vars(MovingAverage().smooth(changed, STEP_S)).values(),
        vars(MovingAverage().smooth(SAMPLES, STEP_S)).values(),
        strict=True,
    ):
        np.testing.assert_array_equal(now[:200], then[:200])
        assert (now[200:] != then[200:]).any()


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
