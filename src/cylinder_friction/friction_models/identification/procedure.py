"""Identification of LuGre from labelled recordings: Stribeck curve first, bristles next, all together last."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from tqdm import tqdm

from cylinder_friction.friction_models.identification.intervals import confidence_intervals
from cylinder_friction.friction_models.identification.motion import Motion, Motions
from cylinder_friction.friction_models.identification.presliding import bristle_stiffness
from cylinder_friction.friction_models.identification.refinement import (
    Coordinates,
    search_globally,
    search_locally,
)
from cylinder_friction.friction_models.identification.steady_points import SteadyPoint, steady_points
from cylinder_friction.friction_models.stribeck import StribeckCurve, fit_stribeck

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from cylinder_friction.friction_models.lugre import LugreParameters
    from cylinder_friction.recordings import Recording

    Array = NDArray[np.float64]

SEARCHED = (
    "coulomb_n",
    "static_n",
    "stribeck_velocity_m_s",
    "stribeck_exponent",
    "viscous_n_s_m",
    "bristle_stiffness_n_m",
    "retract_ratio",
)
"""Parameters of the plain model that the search moves; damping follows from the damping ratio."""

STIFFNESS_FACTORS = (1.0, 10.0)
"""Where the first looks begin, in measured stiffnesses: the error has a minimum with soft bristles, which bend with
the noise of the position, and one with stiff bristles, which switch; which is lower depends on the noise."""

FIRST_LOOK_EVALUATIONS = 150
POLISH_EVALUATIONS = 600


@dataclass(frozen=True)
class SearchEffort:
    """How hard the joint search tries.

    Attributes:
        seed: Seed of the first differential evolution; each restart counts one up.
        population: Members a coordinate.
        generations: Greatest number of generations.
        simulated_recordings: How many recordings differential evolution simulates, spread evenly; the Nelder-Mead
            search after it takes all.
        restarts: How many times the whole search runs; the best end is kept.
    """

    seed: int
    population: int
    generations: int
    simulated_recordings: int
    restarts: int = 1


@dataclass(frozen=True)
class Identification:
    """What an identification found.

    Attributes:
        parameters: The best parameters.
        velocity: Which of the velocities on offer fits best.
        intervals: Confidence interval of every parameter that was searched, in its own unit.
        points: Steady points that the Stribeck curve was fitted to.
        curve: That first curve.
        error_n: Mean absolute error of the parameters on all recordings [N].
        mean_friction_n: Mean absolute label there [N].
        first_error_n: Error of the Stribeck curve and bristle stiffness before the joint search [N].
        history: Least error after each generation of differential evolution, on its recordings [N].
    """

    parameters: LugreParameters
    velocity: str
    intervals: dict[str, tuple[float, float]]
    points: tuple[SteadyPoint, ...]
    curve: StribeckCurve
    error_n: float
    mean_friction_n: float
    first_error_n: float
    history: tuple[float, ...]

    @property
    def error_percent(self) -> float:
        """Mean absolute error over mean absolute label, in percent."""
        return 100.0 * self.error_n / self.mean_friction_n


def identify(
    recordings: Sequence[Recording],
    velocities: dict[str, Callable[[Recording], Array]],
    pressure: Callable[[Recording], Array] | None,
    effort: SearchEffort,
    *,
    mass_kg: float,
    damping_ratio: float,
    dead_band_m_s: float,
    confidence: float,
    also_from: Sequence[LugreParameters] = (),
) -> Identification:
    """Identifies LuGre from labelled recordings.

    The Stribeck curve and the bristle stiffness come from the labels' zero-phase velocity. The joint search
    simulates with the causal velocity that the estimator will have at run time, so that what is identified is what
    is served. Which velocity that is, a short local search with each decides.

    Args:
        recordings: Labelled recordings (columns ``velocity_m_s``, ``friction_n``, ``usable``), one sample time.
        velocities: Velocities on offer: a name to a function from a recording to the velocity that drives the model,
            zero at standstill [m/s].
        pressure: From a recording to the pressure that scales dry friction [Pa]; None for the plain model.
        effort: How hard to search.
        mass_kg: Moving mass [kg].
        damping_ratio: Damping ratio of that mass on the bristles.
        dead_band_m_s: Slower is standstill, in the labels' velocity [m/s].
        confidence: Probability of the intervals.
        also_from: Parameters from which the search starts besides its own, for example those found elsewhere.
    """
    points = steady_points(recordings, dead_band_m_s)
    curve = fit_stribeck(
        np.array([point.velocity_m_s for point in points]),
        np.array([point.friction_n for point in points]),
        np.sqrt(np.array([point.rows for point in points], dtype=np.float64)),
    )
    stiffness = bristle_stiffness(recordings, curve.coulomb_n, dead_band_m_s)

    def motions_of(chosen: Sequence[Recording], name: str) -> Motions:
        return Motions.of(
            [_motion(recording, velocities[name], pressure) for recording in chosen],
            recordings[0].sample_time_s,
        )

    few = _spread(recordings, effort.simulated_recordings)
    on_offer = {name: motions_of(few, name) for name in velocities}
    reference = next(iter(on_offer.values())).reference_pressure_pa if pressure is not None else 0.0
    coordinates = Coordinates.around(curve, mass_kg, damping_ratio, reference)
    starts = [coordinates.start(curve, factor * stiffness) for factor in STIFFNESS_FACTORS]
    starts += [coordinates.point(parameters) for parameters in also_from]
    looks = {
        name: [search_locally(motions, coordinates, start, FIRST_LOOK_EVALUATIONS) for start in starts]
        for name, motions in on_offer.items()
    }
    costs = {
        name: min(on_offer[name].mean_absolute_error(coordinates.parameters(point)) for point in points_of_one)
        for name, points_of_one in looks.items()
    }
    chosen = min(costs, key=lambda name: costs[name])
    everything = motions_of(recordings, chosen)
    point, history = _search(on_offer[chosen], everything, coordinates, looks[chosen], effort)
    parameters = coordinates.parameters(point)
    names = SEARCHED if pressure is None else (*SEARCHED, "pressure_slope_n_pa")
    return Identification(
        parameters=parameters,
        velocity=chosen,
        intervals=confidence_intervals(everything, parameters, names, confidence),
        points=tuple(points),
        curve=curve,
        error_n=everything.mean_absolute_error(parameters),
        mean_friction_n=everything.mean_friction_n,
        first_error_n=everything.mean_absolute_error(coordinates.parameters(starts[0])),
        history=tuple(history),
    )


def _search(
    few: Motions, everything: Motions, coordinates: Coordinates, looks: Sequence[Array], effort: SearchEffort
) -> tuple[Array, list[float]]:
    """Returns the best end of all searches, and the history of the differential evolution that came nearest to it."""
    first = min(looks, key=lambda point: few.mean_absolute_error(coordinates.parameters(point)))
    candidates, histories = list(looks), list[list[float]]()
    total = effort.restarts * effort.generations
    with tqdm(total=total, desc="identify LuGre", unit="generation", disable=None) as progress:
        for restart in range(effort.restarts):
            found, history = search_globally(
                few, coordinates, first, effort.seed + restart, effort.population, effort.generations, progress.update
            )
            candidates.append(found)
            histories.append(history)
    ends = [search_locally(everything, coordinates, candidate, POLISH_EVALUATIONS) for candidate in candidates]
    best = min(ends, key=lambda point: everything.mean_absolute_error(coordinates.parameters(point)))
    return best, min(histories, key=lambda history: history[-1])


def _motion(
    recording: Recording,
    velocity: Callable[[Recording], Array],
    pressure: Callable[[Recording], Array] | None,
) -> Motion:
    return Motion(
        velocity_m_s=velocity(recording),
        pressure_pa=np.zeros(len(recording)) if pressure is None else pressure(recording),
        friction_n=recording.column("friction_n"),
        usable=recording.usable(),
    )


def _spread(recordings: Sequence[Recording], count: int) -> list[Recording]:
    if count >= len(recordings):
        return list(recordings)
    return [recordings[number] for number in np.linspace(0, len(recordings) - 1, count).round().astype(int)]
