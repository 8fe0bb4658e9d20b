"""Analytical models on measured hysteresis, read where it lies; without it these tests are skipped."""

from __future__ import annotations

import math
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

DATA = Path(__file__).parents[3] / "../shared/data"

here = pytest.mark.skipif(not (DATA / "friction-damper").is_dir(), reason="the public measurements are not here")


@pytest.fixture(scope="module")
def hysteresis() -> Any:
    """What the benchmark prints; tests call the same functions."""
    return import_module("measured_hysteresis")


@pytest.fixture(scope="module")
def loops() -> Any:
    return import_module("hysteresis_loops")


def test_a_loop_of_known_shape_gives_its_turns_work_and_stiffness(loops: Any) -> None:
    time_s = np.arange(0.0, 10.0, 1e-3)
    position_m = 0.01 * np.sin(2.0 * np.pi * 0.5 * time_s)
    stiffness_n_m, coulomb_n = 1e6, 500.0
    friction_n, force = np.zeros_like(time_s), 0.0
    for row, step in enumerate(np.diff(position_m), start=1):
        force = float(np.clip(force + stiffness_n_m * step, -coulomb_n, coulomb_n))
        friction_n[row] = force
    assert loops.turns(position_m, 1e-3) == [500 + 1000 * turn for turn in range(10)]
    # A parallelogram: its base is the travel less what the spring takes up, 2 F / k.
    work_j = 2.0 * coulomb_n * (0.02 - 2.0 * coulomb_n / stiffness_n_m)
    assert loops.energies(position_m, friction_n, 1e-3) == pytest.approx([work_j] * 8, rel=1e-3)
    upper, lower = loops.stiffnesses(position_m, friction_n, 1e-3)
    assert (len(upper), len(lower)) == (4, 5)
    assert upper + lower == pytest.approx([stiffness_n_m] * 9, rel=1e-6)
    assert loops.mean_of_directions([(upper, [3e6])]) == pytest.approx(2e6)
    jumping = coulomb_n * np.sign(np.gradient(position_m))
    assert loops.stiffnesses(position_m, jumping, 1e-3) == ([math.inf] * 4, [math.inf] * 5)


@here
@pytest.mark.parametrize(("rig", "stiffness_n_m"), [("damper 36 lb", 6.4e6), ("damper 30 lb", 5.9e6)])
def test_the_dampers_stiffness_and_work_are_the_same_cycle_after_cycle(
    loops: Any, rig: str, stiffness_n_m: float
) -> None:
    measured = loops.rig_of(DATA, rig)
    assert len(measured.loops) == 10
    assert measured.sets == ["identified", "later cycles", "amplitude between", "1 Hz and faster"]
    assert measured.stiffness_n_m == pytest.approx(stiffness_n_m, rel=0.05)
    for one in measured.loops:
        work_j = loops.energies(one.position_m, one.friction_n, measured.least_travel_m)
        assert np.ptp(work_j[3:7]) < 0.1 * np.mean(work_j[3:7])


@here
def test_the_tribometers_stiffness_behind_turns_agrees_with_that_at_zero_force(loops: Any) -> None:
    assert loops.rig_of(DATA, "tribometer").stiffness_n_m == pytest.approx(43.9e3, rel=0.03)


@pytest.fixture(scope="module")
def damper(hysteresis: Any) -> Any:
    return hysteresis.checked(DATA, "damper 30 lb", generations=5)


@here
@pytest.mark.slow
@pytest.mark.parametrize("rows", ["later cycles", "amplitude between", "1 Hz and faster"])
def test_models_with_memory_beat_the_curve_without_on_rows_they_were_not_identified_on(damper: Any, rows: str) -> None:
    for name in ("dahl", "lugre", "gms"):
        assert damper[name].figures[rows].percent < 0.8 * damper["stribeck"].figures[rows].percent, name
    assert math.isinf(damper["stribeck"].figures[rows].stiffness_n_m)


@here
@pytest.mark.slow
def test_identified_parameters_lie_within_their_intervals(damper: Any) -> None:
    for name, found in damper.items():
        for parameter, (low, high) in found.intervals.items():
            assert low < found.parameters.value(parameter) < high, f"{name}, {parameter}"


@here
@pytest.mark.slow
def test_presliding_of_the_tribometer_needs_more_than_one_element(hysteresis: Any) -> None:
    found = hysteresis.checked(DATA, "tribometer", generations=3)
    later = {name: one.figures["later cycles"] for name, one in found.items()}
    assert later["gms"].percent < 6.0 < later["lugre"].percent < later["dahl"].percent < 12.0
    for name in ("dahl", "lugre", "gms"):
        assert later[name].energy_j == pytest.approx(later[name].measured_energy_j, rel=0.05), name
        assert later[name].stiffness_n_m == pytest.approx(later[name].measured_stiffness_n_m, rel=0.2), name
