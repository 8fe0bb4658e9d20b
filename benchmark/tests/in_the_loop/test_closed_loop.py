"""The loop in compiled Python, in plain Python and in C; the observer sample by sample; the command."""

from __future__ import annotations

import ctypes
import json
from typing import TYPE_CHECKING

import numpy as np
import pytest

from friction_benchmark.cli import main
from friction_benchmark.in_the_loop import experiment
from friction_benchmark.in_the_loop.closed_loop import (
    FED,
    POSITION,
    REFERENCE,
    SPOOL,
    START_2_PA,
    Controller,
    control,
    new_observer,
    observer_step,
    plant_tick,
    sense,
    sensor_filter,
)
from friction_benchmark.in_the_loop.compensators import BY_TITLE, Trained, controller_library, train
from friction_benchmark.in_the_loop.courses import course
from friction_benchmark.in_the_loop.experiment import NOMINAL, QUICK, Bench, follow, session
from friction_benchmark.servo_rig import dynamics
from friction_benchmark.servo_rig.dynamics import P1, X, at_rest, element_shares, viscosity_ratio
from friction_benchmark.servo_rig.parameters import CYLINDER
from friction_benchmark.servo_rig.sessions import SEED_WORD, SessionPlan, record

if TYPE_CHECKING:
    from pathlib import Path

GAINS = Controller(5.4e6, integral_1_s=2.0, force_m_s_n=2.8e-6, share=0.9, null_m_s=-1.5e-3)
ROWS = 3000


@pytest.fixture(scope="module")
def bench() -> Bench:
    return Bench(controller_library(), [train(QUICK.trainings[0], QUICK.effort)], GAINS)


def by_hand(bench: Bench, *, in_c: bool) -> np.ndarray:
    """Return position and spool of a loop that calls controller and hybrid one cycle after the other.

    In C, both are C; else both are Python. Rig and sensors are the same.
    """
    rig, (reference_m, load_n) = session(NOMINAL, 1, 0, 0), course("slow sine")
    noise = np.random.default_rng([SEED_WORD, 77, 0, 0]).normal(size=(len(load_n), 4))
    state, elements = at_rest(rig[1], reference_m[0], START_2_PA), element_shares(rig[0])
    filtering = sensor_filter(rig[2], state[P1], START_2_PA)
    integral, sample, oil = np.zeros(1), np.zeros(4), viscosity_ratio(rig[1].oil_c)
    trained = bench.trained[0]
    estimator = trained.exported["hybrid"].stream() if in_c else trained.hybrid.real_time()
    gains, friction, rows = np.array(GAINS), 0.0, []
    for tick in range(ROWS):
        sense(rig[2], filtering, state, load_n[tick], noise[tick], sample)
        if tick % 4 == 0:
            friction = estimator.step(*sample[:3]).friction_n
        rows.append((state[X], state[dynamics.SPOOL]))
        now = np.ascontiguousarray(reference_m[tick : tick + 2])
        if in_c:
            pointers = (each.ctypes.data for each in (gains, integral, now, sample))
            spool = bench.library.loop_control(*pointers, ctypes.c_double(friction))
        else:
            spool = control(GAINS, integral, (now[0], now[1]), sample, friction)
        plant_tick(rig, elements, state, spool, load_n[tick], oil)
    return np.array(rows)


@pytest.mark.slow
def test_the_loop_in_python_and_in_c_gives_the_same_motion_bit_for_bit(bench: Bench) -> None:
    in_python, in_c = by_hand(bench, in_c=False), by_hand(bench, in_c=True)
    np.testing.assert_array_equal(in_c, in_python)
    way = BY_TITLE["hybrid"], GAINS
    first, again = (follow(bench, session(NOMINAL, 1, 0, 0), way, course("slow sine"), 0, 0, 0) for _ in range(2))
    np.testing.assert_array_equal(first[:ROWS][:, [POSITION, SPOOL]], in_python)
    np.testing.assert_array_equal(again, first)
    assert np.abs(first[:, FED]).max() > 100.0


@pytest.mark.slow
def test_the_observer_steps_as_it_estimates(bench: Bench) -> None:
    recording = record(SessionPlan(5, 1, 8.0), "2", 1).recording
    observer = bench.trained[0].observer
    samples = recording.samples()
    kept = new_observer(observer, *samples[0], recording.sample_time_s)
    stepped = [observer_step(kept, *sample, CYLINDER.moving_mass_kg, row) for row, sample in enumerate(samples)]
    np.testing.assert_allclose(stepped, observer.estimate(recording), atol=1e-6)


@pytest.mark.slow
def test_true_friction_fed_forward_follows_better_than_nothing(bench: Bench) -> None:
    rig, path, gains = session(NOMINAL, 1, 0, 0), course("slow sine"), GAINS._replace(integral_1_s=0.0)
    traces = [follow(bench, rig, (BY_TITLE[title], gains), path, 0, 0, 0)[5000:] for title in ("none", "true friction")]
    without, with_truth = (np.std(each[:, REFERENCE] - each[:, POSITION]) for each in traces)
    assert with_truth < 0.6 * without


@pytest.mark.slow
def test_the_command_prints_every_table(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def trained(*_: object) -> Trained:
        return bench.trained[0]

    monkeypatch.setattr(experiment, "train", trained)
    assert main(["in-the-loop", "--quick", "--output", str(tmp_path / "out")]) == 0
    printed = capsys.readouterr().out
    stated = json.loads((tmp_path / "out/in_the_loop.json").read_text(encoding="utf-8"))
    assert stated.pop("cascade")["position_n_m"] > 1e6
    assert len(stated) == 8
    assert all(title in printed for title in (*BY_TITLE, *stated))
    names = {each.name for each in (tmp_path / "out").iterdir()}
    assert names == {"runs.csv", "shares.csv", "lags.csv", "in_the_loop.json", "in_the_loop.png"}
