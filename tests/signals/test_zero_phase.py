import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cylinder_friction.signals.causal_chain import MovingAverage
from cylinder_friction.signals.rts import RtsSmoother
from cylinder_friction.signals.smooth_signals import SignalFilter
from cylinder_friction.signals.zero_phase import CentredMovingAverage, SavitzkyGolay

STEP_S = 0.005
ZERO_PHASE = [CentredMovingAverage(), SavitzkyGolay(), RtsSmoother()]
COEFFICIENT = st.floats(-1.0, 1.0)


@pytest.fixture(params=ZERO_PHASE, ids=lambda each: type(each).__name__)
def zero_phase(request: pytest.FixtureRequest) -> SignalFilter:
    return request.param


def best_lag(seen: np.ndarray, true: np.ndarray) -> int:
    """Return the lag, in samples, at which the two correlate best."""
    lags = range(-40, 41)
    inner = slice(200, len(true) - 200)
    return max(lags, key=lambda lag: float(np.dot(np.roll(seen, -lag)[inner], true[inner])))


def test_no_lag_on_a_sine(zero_phase: SignalFilter) -> None:
    rate = 2.0 * np.pi * 0.5
    phase = rate * STEP_S * np.arange(4000)
    samples = np.column_stack([3e5 * np.sin(phase), 3e5 * np.cos(phase), 0.05 * np.sin(phase)])
    signals = zero_phase.smooth(samples, STEP_S)
    assert best_lag(signals.pressure_1_smooth_pa, np.sin(phase)) == 0
    assert best_lag(signals.pressure_2_smooth_pa, np.cos(phase)) == 0
    assert best_lag(signals.velocity_m_s, np.cos(phase)) == 0
    assert best_lag(signals.acceleration_m_s2, -np.sin(phase)) == 0
    assert best_lag(MovingAverage().smooth(samples, STEP_S).acceleration_m_s2, -np.sin(phase)) == 20


@pytest.mark.parametrize(("sample_time_s", "half"), [(0.02, 5), (0.01, 10), (0.005, 20), (0.002, 50), (0.001, 100)])
def test_windows_last_as_long_at_any_rate(sample_time_s: float, half: int) -> None:
    assert SavitzkyGolay().support(sample_time_s).after == half
    pulse = np.zeros(301)
    pulse[150] = 1.0
    velocity, _ = SavitzkyGolay().motion(pulse, sample_time_s)
    assert np.flatnonzero(np.abs(velocity) > 1e-9)[-1] - 150 == (half + 1) // 2


def test_shortest_windows_hold_two_samples_more_than_the_order() -> None:
    assert SavitzkyGolay(1e-6, 2, 1e-6, 3, 1e-6, 3).support(0.005).after == 2


@given(COEFFICIENT, COEFFICIENT, COEFFICIENT, COEFFICIENT)
def test_savitzky_golay_is_exact_on_cubics_up_to_the_edges(a: float, b: float, c: float, d: float) -> None:
    time_s = STEP_S * np.arange(300)
    cubic = a + b * time_s + c * time_s**2 + d * time_s**3
    quadratic = a + b * time_s + c * time_s**2
    signals = SavitzkyGolay().smooth(np.column_stack([quadratic, quadratic, cubic]), STEP_S)
    np.testing.assert_allclose(signals.pressure_1_smooth_pa, quadratic, atol=1e-9)
    np.testing.assert_allclose(signals.velocity_m_s, b + 2 * c * time_s + 3 * d * time_s**2, atol=1e-8)
    np.testing.assert_allclose(signals.acceleration_m_s2, 2 * c + 6 * d * time_s, atol=1e-6)


@given(COEFFICIENT, COEFFICIENT, COEFFICIENT)
def test_centred_moving_average_is_exact_on_parabolas_away_from_edges(a: float, b: float, c: float) -> None:
    time_s = STEP_S * np.arange(300)
    parabola = a + b * time_s + c * time_s**2
    line = a + b * time_s
    each = CentredMovingAverage()
    signals = each.smooth(np.column_stack([line, line, parabola]), STEP_S)
    inner = slice(each.support(STEP_S).before, -each.support(STEP_S).after)
    np.testing.assert_allclose(signals.pressure_2_smooth_pa, line, atol=1e-9)
    np.testing.assert_allclose(signals.velocity_m_s[inner], (b + 2 * c * time_s)[inner], atol=1e-9)
    np.testing.assert_allclose(signals.acceleration_m_s2[inner], 2 * c, atol=1e-6)


def test_reach_tells_which_rows_an_input_touches(zero_phase: SignalFilter) -> None:
    samples = np.random.default_rng(2).normal(size=(400, 3)) * [1e5, 1e5, 1e-3]
    changed = samples.copy()
    changed[200] *= 2.0
    support = zero_phase.support(STEP_S)
    before, after = (vars(zero_phase.smooth(each, STEP_S)) for each in (samples, changed))
    for name, values in before.items():
        difference = np.abs(after[name] - values)
        outside = np.ones(len(values), dtype=bool)
        outside[200 - support.after : 200 + support.before + 1] = False
        # The smoother's memory never ends; no more than 1 % of the disturbance is left outside.
        assert difference[outside].max() <= 0.011 * difference.max()


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"velocity_window_s": 0.0}, "for velocity: expected a positive window .* got window 0.0 s and order 3"),
        ({"acceleration_order": 1}, "for acceleration: .* an order of at least 2, but got window 0.2 s and order 1"),
    ],
)
def test_impossible_savitzky_golay_is_refused(parameters: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        SavitzkyGolay(**parameters)  # type: ignore[arg-type]


def test_too_short_recordings_are_refused() -> None:
    with pytest.raises(ValueError, match="got 20 samples, but"):
        SavitzkyGolay().smooth(np.zeros((20, 3)), STEP_S)
