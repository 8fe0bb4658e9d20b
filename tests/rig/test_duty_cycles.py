import numpy as np
import pandas as pd
import pytest

from cylinder_friction.rig.duty_cycles import duty_cycle, lever_for_speed
from cylinder_friction.rig.lever import APPROACH, CHAINED, KIND, SINE, hand_step, new_hand
from cylinder_friction.rig.parameters import RigParameters
from cylinder_friction.rig.simulate import balanced_state, simulate

MIDDLE_M, OVERLAP = 0.125, 0.1


def row(target: float, move_s: float, hold_s: float, *, low: float = 0.03, high: float = 0.22, chained: float = 0.0):
    return [0.0, target, move_s, hold_s, 0.0, low, high, 0.3, chained, 1.0]


def test_a_move_is_smooth_and_reaches_its_target() -> None:
    hand, actions = new_hand(), np.array([row(0.6, 0.2, 1.0), row(0.0, 0.2, 1.0)])
    levers = np.array([hand_step(hand, actions, 0.0, 0.1, OVERLAP, MIDDLE_M) for _ in range(800)])
    assert levers[-1] == pytest.approx(0.6)
    assert (np.diff(levers) >= -1e-12).all()
    assert np.abs(np.diff(levers, 2)).max() < 2e-4


def test_near_the_end_the_hand_reverses_after_its_reaction_time() -> None:
    hand = new_hand()
    actions = np.array([row(0.6, 0.2, 20.0), row(0.5, 0.2, 20.0, chained=1.0), row(0.4, 0.2, 5.0)])
    position, levers = 0.20, []
    for _ in range(2000):
        levers.append(hand_step(hand, actions, 0.0, position, OVERLAP, MIDDLE_M))
        position += 0.05 * 0.001 * (levers[-1] > OVERLAP)
    turned = int(np.argmax(np.diff(levers) < -1e-9))
    seen = 1e-3 * turned
    # 20 mm at 50 mm/s take 0.4 s after the lever has left the overlap; then 0.3 s of reaction.
    assert 0.7 < seen < 0.9
    assert levers[-1] == pytest.approx(-0.4), "the correction is skipped, and the next stroke points away from the end"


def test_an_approach_is_left_out_where_the_piston_is_there_already() -> None:
    hand, there = new_hand(), np.array([row(-0.6, 0.2, 20.0), row(0.4, 0.2, 20.0)])
    there[0, KIND] = APPROACH
    levers = [hand_step(hand, there, 0.0, 0.02, OVERLAP, MIDDLE_M) for _ in range(500)]
    assert min(levers) > -1e-3
    assert levers[-1] == pytest.approx(0.4)


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
