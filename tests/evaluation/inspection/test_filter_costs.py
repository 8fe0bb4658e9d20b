"""What each filter costs: delays known in closed form, noise at a standstill that is known."""

import numpy as np
import pytest

from cylinder_friction.evaluation.inspection.filter_costs import filter_costs
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.signals.smooth_signals import SignalFilter, pulse_responses
from cylinder_friction.signals.zero_phase import SavitzkyGolay

Filters = dict[str, "SignalFilter"]
ADAPTIVE = "adaptive: its windows depend on the signal, so that it has no frequency response of its own"


def test_delays_are_those_of_the_theory(strokes: Recording, filters: Filters) -> None:
    costs, left_out = filter_costs(filters, strokes)
    assert left_out == [ADAPTIVE]
    by_name = {cost.name: cost for cost in costs}
    published = by_name["moving_average"]
    # 10 and 30 samples at 200 Hz: (10-1)/2, half a sample of the difference more, (30-1)/2 and another half.
    assert published.pressure_delay_s == pytest.approx(0.0225)
    assert published.velocity_delay_s == pytest.approx(0.025)
    assert published.acceleration_delay_s == pytest.approx(0.100)
    assert published.pressure_bandwidth_hz == pytest.approx(0.443 * 200.0 / 99.0**0.5, rel=0.02)
    assert published.velocity_delay_in_motion_s == pytest.approx(0.025, rel=1e-3)
    for cost in costs:
        if not cost.causal:
            assert abs(cost.pressure_delay_s) < 1e-6
            assert abs(cost.velocity_delay_s) < 1e-6


def test_noise_at_standstill_is_that_of_white_noise_through_the_taps(strokes: Recording, filters: Filters) -> None:
    costs, _ = filter_costs(filters, strokes)
    for cost in costs:
        assert cost.velocity_noise_m_s == pytest.approx(cost.velocity_noise_from_sensor_m_s, rel=0.35), cost.name
    by_name = {cost.name: cost.velocity_noise_from_sensor_m_s for cost in costs}
    _, taps, _ = pulse_responses(filters["savitzky_golay"], strokes.sample_time_s)
    assert by_name["savitzky_golay"] == pytest.approx(2e-5 * np.sqrt(np.sum(taps**2)), rel=0.05)


def test_a_filter_longer_than_the_recording_is_left_out_with_the_reason(strokes: Recording) -> None:
    short = Recording(strokes.metadata, strokes.table.iloc[:100])
    costs, left_out = filter_costs({"long": SavitzkyGolay(velocity_window_s=1.0), "short": SavitzkyGolay()}, short)
    assert [cost.name for cost in costs if not cost.causal] == ["short"]
    assert left_out[0].startswith("long: got 100 samples")
