"""Dahl, LuGre and generalised Maxwell-slip on measured hysteresis loops.

    python public_data/measured_hysteresis.py --data FOLDER [--generations N]

FOLDER holds ``friction-damper`` and ``tribometer``. Force is measured on both, so no force balance is needed:

- damper 36 lb, damper 30 lb: a banded rotary friction damper driven with sines (Coble, Huggins, Cao, Ricles and Downey
  2022). It has backlash, which none of the models includes. Identified on the first half of the sines of 0.25 and
  0.5 Hz with the smallest and the largest amplitude; scored on their second half, on the amplitude between, and at
  1 Hz and more.
- tribometer: a reciprocating test, mostly presliding; identified on its first half, scored on its second.

Each model gets the same search from the same starts. ``stribeck``, which has no memory, is the baseline.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.friction_models.identification.intervals import confidence_intervals
from cylinder_friction.friction_models.identification.search import Coordinates, search_globally, search_locally
from cylinder_friction.friction_models.identification.simulation import Motion, Motions
from friction_benchmark.friction_models import FRICTION_MODELS
from hysteresis_loops import IDENTIFIED, RIGS, Loops, Rig, energies, mean_of_directions, rig_of, stiffnesses

if TYPE_CHECKING:
    from collections.abc import Sequence

    from cylinder_friction.friction_models.model import FrictionModel
    from cylinder_friction.friction_models.parameters import ModelParameters

MODELS = ("stribeck", "dahl", "lugre", "gms")


@dataclass(frozen=True)
class Figures:
    """How one model does on one set of rows.

    Attributes:
        percent: Mean absolute error over mean |measured friction| [%].
        mean_friction_n: That denominator [N].
        rmse_n: Root mean square error [N].
        energy_j, measured_energy_j: Friction's work over a cycle [J].
        stiffness_n_m, measured_stiffness_n_m: Slope of force over travel behind a turn, from 0.8 to 0.2 of the force
            at the turn, mean of the medians of both directions [N/m]; infinite for a model that jumps.
        cycles: Number of whole cycles.
    """

    percent: float
    mean_friction_n: float
    rmse_n: float
    energy_j: float
    measured_energy_j: float
    stiffness_n_m: float
    measured_stiffness_n_m: float
    cycles: int


@dataclass(frozen=True)
class Checked:
    """One model identified on one rig: its parameters with 95 % intervals, and its figures by set."""

    parameters: ModelParameters
    intervals: dict[str, tuple[float, float]]
    figures: dict[str, Figures]


def identified(model: FrictionModel, rig: Rig, generations: int) -> Checked:
    """Identify a model on the rig's rows for that, and scores it on every set."""
    motions = _motions(model, rig.loops, IDENTIFIED)
    coordinates = _coordinates(model, rig)
    starts = [coordinates.start(rig.start, factor * rig.stiffness_n_m) for factor in (1.0, 0.3)]
    ends = [search_locally(motions, coordinates, start, 300) for start in starts]
    best = min(ends, key=lambda point: motions.error_of(coordinates.values(point)))
    found, _ = search_globally(motions, coordinates, best, 1, 6, generations, lambda: None)
    found = search_locally(motions, coordinates, found, 600)
    parameters = coordinates.parameters(found)
    names = tuple(spec.name for spec in model.searched)
    figures = {name: _figures(model, parameters, rig, name) for name in rig.sets}
    return Checked(parameters, confidence_intervals(motions, parameters, names, 0.95), figures)


def _motions(model: FrictionModel, loops: Sequence[Loops], name: str) -> Motions:
    motions = [
        Motion(one.velocity_m_s, np.zeros_like(one.velocity_m_s), one.friction_n, one.scored[name])
        for one in loops
        if name in one.scored
    ]
    return Motions.of(motions, loops[0].sample_time_s, model)


def _coordinates(model: FrictionModel, rig: Rig) -> Coordinates:
    """Return the shared coordinates with bounds for this rig's size in place of a cylinder's."""
    usual = Coordinates.around(model, rig.start, 1e-3, 1.0)
    speed, coulomb = rig.start.stribeck_velocity_m_s, rig.start.coulomb_n
    bounds = {
        "bristle_stiffness_n_m": (0.03 * rig.stiffness_n_m, 30.0 * rig.stiffness_n_m),
        "stribeck_velocity_m_s": (0.01 * speed, 10.0 * speed),
        "viscous_n_s_m": (1e-4 * coulomb / speed, 0.1 * coulomb / speed),
        "attraction_n_s": (1e-2 * coulomb, 1e3 * coulomb),
    }
    lower, upper = usual.lower.copy(), usual.upper.copy()
    for number, spec in enumerate(model.searched):
        if spec.name in bounds:
            lower[number], upper[number] = np.log(bounds[spec.name])
    return replace(usual, lower=lower, upper=upper)


def _figures(model: FrictionModel, parameters: ModelParameters, rig: Rig, name: str) -> Figures:
    errors, labels = [], []
    work: dict[str, list[float]] = {"model": [], "measured": []}
    slopes: dict[str, list[tuple[list[float], list[float]]]] = {"model": [], "measured": []}
    for one in rig.loops:
        if name not in one.scored:
            continue
        rows = one.scored[name]
        friction = model.simulate(parameters.packed(), one.velocity_m_s, one.sample_time_s, model.new_state())
        errors.append((friction - one.friction_n)[rows])
        labels.append(one.friction_n[rows])
        for whose, force in (("model", friction), ("measured", one.friction_n)):
            work[whose] += energies(one.position_m[rows], force[rows], rig.least_travel_m)
            slopes[whose].append(stiffnesses(one.position_m[rows], force[rows], rig.least_travel_m))
    error, label = np.concatenate(errors), np.concatenate(labels)
    mean_n = float(np.mean(np.abs(label)))
    return Figures(
        percent=100.0 * float(np.mean(np.abs(error))) / mean_n,
        mean_friction_n=mean_n,
        rmse_n=float(np.sqrt(np.mean(error**2))),
        energy_j=float(np.mean(work["model"])),
        measured_energy_j=float(np.mean(work["measured"])),
        stiffness_n_m=mean_of_directions(slopes["model"]),
        measured_stiffness_n_m=mean_of_directions(slopes["measured"]),
        cycles=len(work["measured"]),
    )


def checked(data: Path, rig: str, generations: int = 25, models: Sequence[str] = MODELS) -> dict[str, Checked]:
    """Return every model, identified and scored on one rig."""
    measured = rig_of(data, rig)
    return {name: identified(FRICTION_MODELS[name], measured, generations) for name in models}


def newtons(force_n: float) -> str:
    return f"{force_n:.0f}" if force_n >= 100.0 else f"{force_n:.3f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--generations", type=int, default=25)
    arguments = parser.parse_args()
    head = (
        "rig",
        "rows",
        "model",
        "MAE [%]",
        "mean |F| [N]",
        "RMSE [N]",
        "work a cycle [%]",
        "stiffness [%]",
        "cycles",
    )
    print("{:13s} {:18s} {:9s} {:>8s} {:>13s} {:>9s} {:>17s} {:>14s}".format(*head))
    for rig in RIGS:
        for name, found in checked(arguments.data, rig, arguments.generations).items():
            for scored, figures in found.figures.items():
                stiffness = 100.0 * figures.stiffness_n_m / figures.measured_stiffness_n_m
                print(
                    f"{rig:13s} {scored:18s} {name:9s} {figures.percent:8.1f} {newtons(figures.mean_friction_n):>13s} "
                    f"{newtons(figures.rmse_n):>9s} {100.0 * figures.energy_j / figures.measured_energy_j:17.1f} "
                    f"{'jumps' if math.isinf(stiffness) else f'{stiffness:.0f}':>14s}"
                )


if __name__ == "__main__":
    main()
