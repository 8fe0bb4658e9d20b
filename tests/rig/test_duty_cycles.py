import numpy as np
import pandas as pd
import pytest

from cylinder_friction.rig.duty_cycles import duty_cycle, lever_for_speed
from cylinder_friction.rig.lever import CHAINED, SINE
from cylinder_friction.rig.parameters import RigParameters
from cylinder_friction.rig.simulate import balanced_state, simulate

MIDDLE_M, OVERLAP = 0.125, 0.1


@pytest.mark.parametrize("speed_m_s", [0.005, 0.02, 0.04, -0.005, -0.02, -0.04])
def test_lever_for_speed_gives_about_that_speed(rigs: dict[str, RigParameters], speed_m_s: float) -> None:
    rig = rigs["1"]
    lever = np.full(2002, lever_for_speed(rig, speed_m_s))
    trace = simulate(rig, lever, balanced_state(rig, 0.125, 8e5, 35.0), 2.0)
    assert trace["velocity_m_s"].tail(300).mean() == pytest.approx(speed_m_s, rel=0.1)


def test_duty_cycles_mix_free_work_with_exercises(rigs: dict[str, RigParameters]) -> None:
    even, odd = (duty_cycle(rigs["1"], np.random.default_rng(3), 60.0, turn) for turn in (0, 1))
    assert (odd.actions[:, 0] == SINE).sum() == 2
    assert (even.actions[:, 0] == SINE).sum() == 0
    assert (even.actions[:, CHAINED] == 1.0).sum() > 5
    assert np.abs(even.actions[:, 1]).max() <= 1.0


def test_no_load_recordings_have_ten_steady_speeds_in_either_direction(traces: dict[str, pd.DataFrame]) -> None:
    velocity = traces["1"]["velocity_m_s"].rolling(200)
    steady = velocity.std() < 0.05 * velocity.mean().abs()
    means = velocity.mean()[steady]
    for sign in (1.0, -1.0):
        speeds = sign * means[(sign * means > 1e-3)]
        # Bins a fifth apart from 1 to 60 mm/s.
        filled = np.unique(np.floor(np.log(speeds / 1e-3) / np.log(1.2)))
        assert len(filled) >= 10
        assert speeds.max() / speeds.min() > 10.0


@pytest.mark.parametrize("condition", ["1", "4"])
def test_a_person_at_the_lever_uses_the_stroke_and_rests_now_and_then(
    traces: dict[str, pd.DataFrame], condition: str
) -> None:
    trace = traces[condition]
    assert np.ptp(trace["position_m"]) > 0.1
    moving = trace["velocity_m_s"].abs() > 2e-3
    assert 0.45 < moving.mean() < 0.95
    reversals = np.diff(np.sign(trace["velocity_m_s"][moving])) != 0
    assert reversals.sum() >= 10
