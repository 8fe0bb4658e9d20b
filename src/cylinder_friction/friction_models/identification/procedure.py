"""Identification of a friction model from labelled recordings: Stribeck curve, bristles, all parameters jointly."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.execution.progress import progress
from cylinder_friction.friction_models.identification.intervals import confidence_intervals
from cylinder_friction.friction_models.identification.presliding import bristle_stiffness
from cylinder_friction.friction_models.identification.search import Coordinates, search_globally, search_locally
from cylinder_friction.friction_models.identification.simulation import Motion, Motions
from cylinder_friction.friction_models.identification.steady_points import SteadyPoint, curve_through, steady_points
from cylinder_friction.friction_models.model import FrictionModel
from cylinder_friction.friction_models.parameters import ModelParameters
from cylinder_friction.friction_models.stribeck import StribeckCurve
from cylinder_friction.recordings.recording import Recording

STIFFNESS_FACTORS = (1.0, 10.0)
"""Starting stiffnesses of the first local searches, as multiples of the measured stiffness. The error has one minimum
with soft bristles, which bend with the position's noise, and another with stiff bristles, which switch. The noise
decides which minimum is lower."""

_GOLDEN_RATIO = (math.sqrt(5.0) - 1.0) / 2.0

ALIKE_EVALUATIONS = 100
SEARCH_STEP_S = 0.005
"""Step of the simulations that a search makes of recordings with a shorter sample time [s]. The velocities that drive
the model are slopes over several times as long."""
PIECE_LEAD_S = 0.5
"""Time at the start of a piece that the error ignores, because the model begins the piece in a fresh state [s]."""


@dataclass(frozen=True)
class SearchEffort:
    """Budget of the joint search."""

    seed: int  # Seed of differential evolution
    population: int  # Members per coordinate
    generations: int  # Greatest number of generations
    # Number of recordings, evenly spaced, that the first local searches and differential evolution simulate
    simulated_recordings: int
    first_look_evaluations: int = 80  # Simulations of each first local search, per candidate velocity and start
    polish_evaluations: int = 400  # Most simulations of each local search at the end
    # Duration of the piece of each recording that the first local searches and differential evolution simulate [s]; 0
    # means the whole recording. Pieces start at a different place in each recording
    piece_s: float = 0.0
    polished_piece_s: float = 0.0  # Piece that the local searches at the end simulate [s]; 0: whole recording


@dataclass(frozen=True)
class Identification:
    """Result of an identification."""

    parameters: ModelParameters  # The best parameters
    velocity: str  # Name of the candidate velocity that fits best
    # Confidence interval of every parameter that was searched, in its own unit
    intervals: dict[str, tuple[float, float]]
    points: tuple[SteadyPoint, ...]  # Steady points that the Stribeck curve was fitted to
    curve: StribeckCurve  # Stribeck curve fitted to those points
    error_n: float  # Mean absolute error of the parameters on all recordings [N]
    mean_friction_n: float  # Mean absolute label of all recordings [N]
    history: tuple[float, ...]  # Least error of differential evolution after each generation [N]

    @property
    def error_percent(self) -> float:
        """Mean absolute error over mean absolute label, in percent."""
        return 100.0 * self.error_n / self.mean_friction_n


def identify(
    model: FrictionModel,
    recordings: Sequence[Recording],
    velocities: dict[str, Callable[[Recording], Array]],
    pressure: Callable[[Recording], Array] | None,
    effort: SearchEffort,
    *,
    mass_kg: float,
    damping_ratio: float,
    dead_band_m_s: float,
    confidence: float,
    offset_n: float = 0.0,
    alike: float | None = None,
    recordings_differ: bool = False,
) -> Identification:
    """Identify a friction model from labelled recordings.

    The Stribeck curve and the bristle stiffness come from the labels' zero-phase velocity. The joint search
    simulates with a causal velocity, which the estimator has at run time too. A short local search with each candidate
    velocity decides which one the model uses.

    Args:
        recordings: Labelled recordings (columns ``velocity_m_s``, ``friction_n``, ``usable``), one sample time.
        velocities: Candidates by name: functions from a recording to the velocity that drives the model, zero at
            standstill [m/s].
        pressure: Function from a recording to the pressure that scales dry friction [Pa]; None if the model uses none.
        mass_kg, damping_ratio: Moving mass [kg], and its damping ratio on the bristles.
        dead_band_m_s: Speed in the labels below which the piston counts as standing [m/s].
        confidence: Probability of the confidence intervals.
        offset_n: Standard uncertainty of an offset in all friction, as sensors' zeros cause [N].
        alike: Intervals also contain what is identified with each other velocity whose error exceeds the least by at
            most this share of mean |friction|: filter and gate bias parameters by more than noise scatters them. None:
            they do not.
        recordings_differ: Whether intervals also hold the scatter of whole recordings.

    Raises:
        ValueError: Steady sliding gives too few points.
    """
    time_s = recordings[0].sample_time_s
    thinner = max(1, int(SEARCH_STEP_S / time_s + 1e-6))
    points = steady_points(recordings, dead_band_m_s)
    curve = curve_through(points)
    stiffness = bristle_stiffness(recordings, curve.coulomb_n, dead_band_m_s)

    def motions_of(chosen: Sequence[Recording], name: str, piece_s: float = 0.0, every: int = thinner) -> Motions:
        motions = [_motion(recording, velocities[name], pressure, every) for recording in chosen]
        return Motions.of(_pieces(motions, piece_s, every * time_s), every * time_s, model)

    few = _spread(recordings, effort.simulated_recordings)
    offered = {name: motions_of(few, name, effort.piece_s) for name in velocities}
    reference = next(iter(offered.values())).reference_pressure_pa if pressure is not None else 0.0
    coordinates = Coordinates.around(model, curve, mass_kg, damping_ratio, reference)
    starts = [coordinates.start(curve, factor * stiffness) for factor in STIFFNESS_FACTORS]
    chosen, looks = _first_looks(offered, coordinates, starts, effort.first_look_evaluations)
    polished = motions_of(recordings, chosen, effort.polished_piece_s)
    point, history = _search(offered[chosen], polished, coordinates, looks, effort)
    parameters = coordinates.parameters(point)
    everything, names = motions_of(recordings, chosen, every=1), tuple(spec.name for spec in model.searched)
    intervals = confidence_intervals(everything, parameters, names, confidence, offset_n, recordings_differ)
    error_n, level_n = everything.error_of(parameters.packed()), everything.mean_friction_n
    as_searched_n = motions_of(recordings, chosen).error_of(parameters.packed())
    others = () if alike is None else progress(velocities, f"intervals {model.title}", unit="candidate")
    for name in others:
        motions = motions_of(recordings, name)
        end = search_locally(motions, coordinates, point, ALIKE_EVALUATIONS)
        if motions.error_of(coordinates.values(end)) <= as_searched_n + (alike or 0.0) * level_n:
            other = coordinates.parameters(end)
            for key, (lower, upper) in intervals.items():
                intervals[key] = min(lower, other.value(key)), max(upper, other.value(key))
    return Identification(parameters, chosen, intervals, tuple(points), curve, error_n, level_n, tuple(history))


def _first_looks(
    offered: dict[str, Motions], coordinates: Coordinates, starts: Sequence[Array], evaluations: int
) -> tuple[str, list[Array]]:
    """Search briefly from each start; return the velocity with the least error and the points found with it."""
    shown = progress(offered.items(), f"velocities {coordinates.model.title}", unit="candidate")
    looks = {
        name: [search_locally(motions, coordinates, start, evaluations) for start in starts] for name, motions in shown
    }
    chosen = min(
        looks, key=lambda name: min(offered[name].error_of(coordinates.values(point)) for point in looks[name])
    )
    return chosen, looks[chosen]


def _search(
    few: Motions, polished: Motions, coordinates: Coordinates, looks: Sequence[Array], effort: SearchEffort
) -> tuple[Array, list[float]]:
    """Search for the best point; return it with the history of differential evolution."""
    first, words = min(looks, key=lambda point: few.error_of(coordinates.values(point))), coordinates.model.title
    with progress(words=f"identify {words}", total=effort.generations, unit="generation") as bar:
        found, history = search_globally(
            few, coordinates, first, effort.seed, effort.population, effort.generations, bar.update
        )
    shown = progress((*looks, found), f"refine {words}", unit="start")
    ends = [search_locally(polished, coordinates, each, effort.polish_evaluations) for each in shown]
    return min(ends, key=lambda point: polished.error_of(coordinates.values(point))), history


def _motion(
    recording: Recording,
    velocity: Callable[[Recording], Array],
    pressure: Callable[[Recording], Array] | None,
    rows: int,
) -> Motion:
    """Join this many rows to one, with the mean velocity and pressure, and the label at the end."""
    whole, ends = len(recording) // rows * rows, slice(rows - 1, None, rows)
    pressure_pa = np.zeros(len(recording)) if pressure is None else pressure(recording)
    means = [each[:whole].reshape(-1, rows).mean(axis=1) for each in (velocity(recording), pressure_pa)]
    return Motion(means[0], means[1], recording.column("friction_n")[ends], recording.usable()[ends])


def _pieces(motions: Sequence[Motion], piece_s: float, sample_time_s: float) -> list[Motion]:
    """Cut one piece from each motion, at places spread evenly by steps of the golden ratio, and join the pieces."""
    length, lead = round(piece_s / sample_time_s), round(PIECE_LEAD_S / sample_time_s)
    if length == 0:
        return list(motions)
    pieces = []
    for number, motion in enumerate(motions):
        start = round(number * _GOLDEN_RATIO % 1.0 * max(len(motion.usable) - length, 0))
        rows = slice(start, start + length)
        usable = motion.usable[rows].copy()
        usable[:lead] = False
        pieces.append(Motion(motion.velocity_m_s[rows], motion.pressure_pa[rows], motion.friction_n[rows], usable))
    joined = zip(*(vars(piece).values() for piece in pieces), strict=True)
    return [Motion(*map(np.concatenate, joined))]


def _spread(recordings: Sequence[Recording], count: int) -> list[Recording]:
    places = np.linspace(0, len(recordings) - 1, min(count, len(recordings)))
    return [recordings[number] for number in places.round().astype(int)]
