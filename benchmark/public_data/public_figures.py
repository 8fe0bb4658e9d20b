"""What four public measurements give: mass, load and friction, LuGre, and presliding stiffness."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import minimize

from cylinder_friction.estimators.baselines import baselines
from cylinder_friction.estimators.forest import ForestPlan
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.lugre import LugreEstimator
from cylinder_friction.estimators.training_plan import Architecture, TrainingPlan
from cylinder_friction.friction_models.identification.intervals import confidence_intervals
from cylinder_friction.friction_models.identification.simulation import Motion, Motions
from cylinder_friction.friction_models.lugre import LuGre, LugreParameters
from cylinder_friction.labelling.equation_of_motion import drive_force
from cylinder_friction.labelling.load import LoadPlan
from cylinder_friction.labelling.pooled_load import pooled_load
from cylinder_friction.labelling.sliding_blocks import zero_uncertainty_n
from cylinder_friction.recordings.columns import LOAD_FORCE
from cylinder_friction.signals.smooth_signals import signals_of
from presliding_stiffness import PreslidingStiffness, presliding_stiffness
from public_data import CYLINDERS, labelled, recordings_of

if TYPE_CHECKING:
    from pathlib import Path

    from cylinder_friction.arrays import Array
    from cylinder_friction.estimators.base import FrictionEstimator
    from cylinder_friction.labelling.mass import MotionIdentification
    from cylinder_friction.labelling.session import SessionIdentification
    from cylinder_friction.recordings.recording import Recording

EMPS_FILES = ("DATA_EMPS", "DATA_EMPS_PULSES")
SEALS = ("NAPN", "O-ring")
SEAL_PRESSURES_BAR = (1, 3, 5, 7)
CRANE_RUNS = ("JibSineTest", "Dual2SineTest")
PUBLISHED_EMPS = {"mass_kg": 95.1, "viscous_n_s_m": 203.0, "coulomb_n": 20.4}
PRESLIDING_TRAVEL_M = 1e-5
SLOWEST_M_S = 1e-5
SLOWEST_MOVING_M_S, BLOCK_S = 0.001, 0.05


@dataclass(frozen=True)
class EmpsFigures:
    """What was identified on one file, and how well it predicts the force of both.

    Attributes:
        motion: Mass of the estimation file, with its interval.
        parameters: Mass, viscous and Coulomb friction, and a constant force of the estimation file, by name.
        force_error_percent: Root mean square error over that of the force itself, row by row, by file.
        block_error_percent: The same of means over 0.05 s, in which vibration of the stage averages out.
    """

    motion: MotionIdentification
    parameters: dict[str, float]
    force_error_percent: dict[str, float]
    block_error_percent: dict[str, float]


def emps(data: Path) -> EmpsFigures:
    """Identify mass and friction on the estimation file and predicts the force of both files."""
    recordings = {name: recordings_of(data / f"emps/{name}.mat", "emps") for name in EMPS_FILES}
    (recording,), found = labelled(recordings[EMPS_FILES[0]], "emps", inertia="identified")
    motion = found.motion
    assert motion is not None
    moving = recording.usable() & (np.abs(recording.column("velocity_m_s")) >= SLOWEST_MOVING_M_S)
    velocity = recording.column("velocity_m_s")[moving]
    design = np.column_stack([velocity, np.sign(velocity), np.ones(len(velocity))])
    friction = np.linalg.lstsq(design, recording.column("friction_n")[moving])[0].tolist()
    names = ("mass_kg", "viscous_n_s_m", "coulomb_n", "offset_n")
    parameters = dict(zip(names, (motion.mass_kg, *friction), strict=True))
    by_row, by_block = {}, {}
    for name in EMPS_FILES:
        (recording,), _ = labelled(recordings[name], "emps")
        by_row[name], by_block[name] = _force_errors_percent(recording, parameters)
    return EmpsFigures(motion, parameters, by_row, by_block)


def _force_errors_percent(recording: Recording, parameters: dict[str, float]) -> tuple[float, float]:
    """Return the relative error of the predicted force, of rows and of means over ``BLOCK_S``."""
    signals, usable = signals_of(recording), recording.usable()
    force_n = drive_force(signals, CYLINDERS["emps"])
    velocity, acceleration = signals.velocity_m_s, signals.acceleration_m_s2
    friction_n = parameters["viscous_n_s_m"] * velocity + parameters["coulomb_n"] * np.sign(velocity)
    error_n = force_n - (parameters["mass_kg"] * acceleration + friction_n + parameters["offset_n"])
    size = round(BLOCK_S / recording.sample_time_s)
    blocks = np.arange(len(force_n) // size * size).reshape(-1, size)
    blocks = blocks[usable[blocks].all(axis=1)]
    force, error = (each[blocks].mean(axis=1) for each in (force_n, error_n))
    return _relative_percent(error_n[usable], force_n[usable]), _relative_percent(error, force)


def _relative_percent(error_n: Array, force_n: Array) -> float:
    return 100.0 * float(np.sqrt(np.mean(error_n**2) / np.mean(force_n**2)))


@dataclass(frozen=True)
class CraneFigures:
    """Figures of one run, and the error of the other run's LuGre on it.

    Attributes:
        found: Load and friction of the run.
        greatest_asymmetry_percent: Greatest difference of friction up and down at one place, over their mean.
        lugre_mae_n: Mean absolute error of LuGre, identified on the other run, against this run's label [N].
        lugre_percent: That over the mean absolute label of the same rows.
        own_percent: The same of LuGre identified on this run itself.
        others_load_percent: The same of real-time estimators that know the other run's load and friction, by name.
        own_load_percent: The same of those that know the other run's friction and this run's load.
        stated_zero_n: Standard uncertainty of the pressure sensors' zeros as stated, as friction [N]; None where the
            file states none.
    """

    found: SessionIdentification
    greatest_asymmetry_percent: float
    lugre_mae_n: float
    lugre_percent: float
    own_percent: float
    others_load_percent: dict[str, float]
    own_load_percent: dict[str, float]
    stated_zero_n: float | None


def crane(data: Path, generations: int = 30) -> dict[str, CraneFigures]:
    """Identify the load of each run from itself; score on it LuGre and the real-time estimators of the other run."""
    runs, estimators = {}, {}
    for name in CRANE_RUNS:
        recordings = recordings_of(data / f"crane/{name}_230425__100Hz.csv.gz", "crane")
        labels, found = labelled(recordings, "crane", load="position")
        runs[name] = (labels, found)
        estimator = LugreEstimator(
            CYLINDERS["crane"], condition=labels[0].metadata.condition, seed=1, population=10, generations=generations
        )
        estimator.fit(labels)
        estimators[name] = estimator
    figures = {}
    for name, (labels, found) in runs.items():
        other = next(each for each in CRANE_RUNS if each != name)
        mae_n, percent = _error(estimators[other], labels)
        own_percent = _error(estimators[name], labels)[1]
        assert found.load is not None
        fitted, own_load = _estimators_of(*runs[other]), pooled_load([found.load])
        others = {each: _error(one, labels)[1] for each, one in fitted.items()}
        own = {each: _error(one.with_position_load(own_load), labels)[1] for each, one in fitted.items()}
        stated_n = zero_uncertainty_n(labels[0].without_columns(LOAD_FORCE), CYLINDERS["crane"])
        figures[name] = CraneFigures(
            found, asymmetry_percent(labels), mae_n, percent, own_percent, others, own, stated_n
        )
    return figures


def _estimators_of(labels: list[Recording], found: SessionIdentification) -> dict[str, FrictionEstimator]:
    """Return the estimators that learn from one run, its load taken off as a function of position."""
    assert found.load is not None
    cylinder, load = CYLINDERS["crane"], pooled_load([found.load])
    chosen = baselines(cylinder, position_load=load)
    plan = TrainingPlan(epochs=60, patience=None, sequence_length=100, burn_in=50)
    chosen["hybrid"] = HybridEstimator(
        cylinder, "force_balance", Architecture(nodes=16), plan, ForestPlan(16, 6, leaf=40), position_load=load
    )
    names = ("force_balance_unfiltered", "force_balance_low_pass", "ridge", "hybrid")
    return {name: chosen[name].fit(labels) for name in names}


def asymmetry_percent(recordings: list[Recording], bins: int = 8, slowest_m_s: float = 2e-3) -> float:
    """Return the greatest difference of median friction up and down in a bin of position, over their mean [%].

    A difference that is the same everywhere has gone into the load; what a smooth load cannot take up shows here.
    """
    position_m, velocity, friction_n = (
        np.concatenate([each.column(name)[each.usable()] for each in recordings])
        for name in ("position_m", "velocity_m_s", "friction_n")
    )
    edges = np.linspace(position_m.min(), position_m.max(), bins + 1)[1:-1]
    place = np.digitize(position_m, edges)
    worst = 0.0
    for number in range(bins):
        up, down = (
            np.median(np.abs(friction_n[(place == number) & (sign * velocity > slowest_m_s)])) for sign in (1.0, -1.0)
        )
        worst = max(worst, 100.0 * float(abs(up - down) / (0.5 * (up + down))))
    return worst


def _error(estimator: FrictionEstimator, recordings: list[Recording]) -> tuple[float, float]:
    errors, labels = [], []
    for recording in recordings:
        usable, label = recording.usable(), recording.column("friction_n")
        errors.append(np.abs(estimator.estimate(recording) - label)[usable])
        labels.append(np.abs(label)[usable])
    mae_n = float(np.concatenate(errors).mean())
    return mae_n, 100.0 * mae_n / float(np.concatenate(labels).mean())


def seals(data: Path) -> dict[str, dict[int, SessionIdentification]]:
    """Return load (the pressure) and friction (half the difference) of each seal at each pressure in bar."""
    plan = LoadPlan(settling_travel_m=5e-3)
    return {
        seal: {
            bar: labelled(
                recordings_of(data / f"pneumatic-seals/{seal}_{bar}bar.csv.gz", "pneumatic-seals"),
                "pneumatic-seals",
                load="position",
                plan=plan,
            )[1]
            for bar in SEAL_PRESSURES_BAR
        }
        for seal in SEALS
    }


@dataclass(frozen=True)
class TribometerFigures:
    """Presliding stiffness, from reversals and from LuGre simulated over the whole test.

    Attributes:
        reversals: By the slope where friction passes through zero.
        by_level: The same with other shares of Coulomb friction as the range of rows [N/m].
        lugre: Coulomb friction and bristle stiffness of the best simulation.
        lugre_interval_n_m: Interval of that bristle stiffness [N/m].
        lugre_percent: Mean absolute error over mean absolute friction.
    """

    reversals: PreslidingStiffness
    by_level: dict[float, float]
    lugre: LugreParameters
    lugre_interval_n_m: tuple[float, float]
    lugre_percent: float


def tribometer(data: Path) -> TribometerFigures:
    """Identify the presliding stiffness of the test, from the first motion to the last."""
    (raw,) = recordings_of(data / "tribometer/test_data_2.txt", "tribometer")
    (whole,), _ = labelled([raw], "tribometer")
    first, last = np.flatnonzero(np.abs(whole.column("velocity_m_s")) > SLOWEST_M_S)[[0, -1]]
    recording = whole.rows(slice(first, last + 1))
    position_m, friction_n = recording.column("position_m"), recording.column("friction_n")
    reversals = presliding_stiffness(position_m, friction_n, PRESLIDING_TRAVEL_M)
    by_level = {
        level: presliding_stiffness(position_m, friction_n, PRESLIDING_TRAVEL_M, level).stiffness_n_m
        for level in (0.3, 0.5, 0.7, 0.9)
    }
    lugre, interval, percent = _lugre_stiffness(recording, reversals)
    return TribometerFigures(reversals, by_level, lugre, interval, percent)


def _lugre_stiffness(
    recording: Recording, start: PreslidingStiffness
) -> tuple[LugreParameters, tuple[float, float], float]:
    """Return LuGre with the Coulomb friction and bristle stiffness that simulate the friction best."""
    velocity, friction_n = recording.column("velocity_m_s"), recording.column("friction_n")
    motion = Motion(velocity, np.zeros_like(velocity), friction_n, recording.usable())
    motions = Motions.of([motion], recording.sample_time_s, LuGre(pressure_scaled=True))

    def parameters(logarithms: Array) -> LugreParameters:
        coulomb, stiffness = np.exp(logarithms)
        return LugreParameters(coulomb, coulomb, 1e-3, 1.0, 0.0, stiffness, 0.0, 1e-3)

    best = minimize(
        lambda logarithms: motions.error_of(parameters(logarithms).packed()),
        np.log([start.coulomb_n, start.stiffness_n_m]),
        method="Nelder-Mead",
        options={"xatol": 1e-5, "fatol": 1e-9},
    )
    lugre = parameters(best.x)
    intervals = confidence_intervals(motions, lugre, ("coulomb_n", "bristle_stiffness_n_m"), 0.95)
    return lugre, intervals["bristle_stiffness_n_m"], 100.0 * float(best.fun) / motions.mean_friction_n
