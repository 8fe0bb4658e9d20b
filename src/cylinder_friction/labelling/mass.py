"""The moving mass, identified from how force and acceleration vary together while the piston slides.

    F_drive - F_load = m·a + friction(direction, speed, pressure)

Force, speed and acceleration are means of the raw signals over one window (modulating functions:
Shinbrot 1957). Acceleration is the position weighted with the window's second derivative, so no
filter touches one side alone.

Friction of each direction is a polynomial of speed, a Stribeck term, and a term of the pressure in
the chamber that does not answer to the force. What remains is friction that lags behind the speed:
it is larger while accelerating than while decelerating, exactly as mass would make it. Two
regressions bracket the mass. One starts early in the stroke and ignores the lag. The other leaves
out the first centimetre and gives slow sliding a lag of its own. The interval holds both. It is
wider by what a lag of ``LATE_S`` imitates, and by what seals imitate that the force of inertia
presses.

A hydraulic cylinder's motion seldom determines its mass: 6 kg at 1 m/s² are 6 N, while friction is
hundreds of newtons. Then ``mass_known`` is False.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from cylinder_friction.arrays import Array, Mask, sliding_extremes
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.labelling.averages import Averages
from cylinder_friction.labelling.robust import clustered_half_widths, robust_fit
from cylinder_friction.recordings.columns import DRIVE_FORCE, LOAD_FORCE, PRESSURES
from cylinder_friction.recordings.recording import Recording, RecordingError
from cylinder_friction.signals.motion import direction_of_motion, travel_since_stop
from cylinder_friction.signals.smooth_signals import has_pressures, in_chambers

SLOWEST_M_S = 1e-3
"""Speed below which a row excludes its window, as friction may be anything at rest [m/s]."""
WINDOW_S, CLUSTER_S = 0.2, 1.0
"""Duration of a window, and of a cluster, whose residuals may be correlated [s]."""
WINDOWS_APART = 4
"""Windows begin at this fraction of their length after each other."""
EARLY_M, LATE_M = 0.003, 0.01
"""Travel since standstill at which each of the two regressions begins [m]."""
STRIBECK_M_S = (0.01, 0.04)
"""Speeds over which the Stribeck effect may fade [m/s]."""
LAG_M_S = 0.02
"""Speed over which the lag of friction fades [m/s]."""
LATE_S = 0.025
"""Time by which friction that falls with speed may be late, as a film of oil builds slowly [s]."""
SLOPE_M_S, FAST = 1e-3, 0.9
"""Difference of speed for friction's slope [m/s]; quantile of speed above which it is viscous."""
PRESSED = 0.05
"""Largest error of the mass, as a share, by seals that inertia presses: 16 N/bar of 312 N/bar."""
WIDEST = 0.3
"""Half the width of the interval, over the mass, above which the mass counts as unknown."""
_LEAST_WINDOWS = 40
_LEAST_SHARE = 0.1  # Least force of inertia left in a label, over its mean friction, that is worth a word
_OUTLIER_MULTIPLE = 3.0
"""Huber's threshold, wide enough to keep the full weight of friction outside the model."""


@dataclass(frozen=True)
class MotionPoints(Averages):
    """Means over windows in motion, each of shape ``(windows,)``."""

    group = "cluster"

    direction: Array  # Sign of velocity
    travel_m: Array  # Travel since the last standstill or reversal [m]
    chamber_1_n: Array  # Force of the oil on the piston side; 0 if no pressures were measured [N]
    chamber_2_n: Array  # Force of the oil on the rod side [N]
    cluster: NDArray[np.int64]  # Number of the window's cluster of ``CLUSTER_S``, counted from 0


@dataclass(frozen=True)
class MotionIdentification:
    """The moving mass with its confidence interval."""

    mass_kg: float  # Moving mass, the middle of its interval [kg]
    mass_interval_kg: tuple[float, float]  # Interval of the mass [kg]
    residual_n: float  # Root mean square residual of the windows [N]
    confidence: float  # Probability of the interval

    @property
    def mass_known(self) -> bool:
        """Whether the motion determines the mass, to ``WIDEST`` of itself."""
        low, high = self.mass_interval_kg
        return 0.5 * (high - low) <= WIDEST * self.mass_kg

    def sentence(self) -> str:
        """State in words whether the motion determines the mass; an unknown mass has no number."""
        if self.mass_known:
            low, high = self.mass_interval_kg
            return (
                f"the moving mass was identified as {self.mass_kg:.4g} kg, "
                f"{100 * self.confidence:g} % interval {low:.4g} to {high:.4g} kg"
            )
        return (
            f"the motion does not determine the moving mass to ± {100 * WIDEST:.0f} %; "
            "record strokes that accelerate harder, or give the mass"
        )

    def to_dict(self) -> dict[str, Any]:
        """Collect the content as JSON-compatible values; a mass that is not known is null."""
        known = self.mass_known
        return {
            "mass_kg": self.mass_kg if known else None,
            "mass_interval_kg": self.mass_interval_kg if known else None,
            "mass_known": known,
            "mass_summary": self.sentence(),
            "residual_n": self.residual_n,
            "confidence": self.confidence,
        }


def motion_points(
    force_n: Array,
    position_m: Array,
    velocity_m_s: Array,
    sample_time_s: float,
    usable: Mask | None = None,
    chambers_n: Array | None = None,
) -> MotionPoints:
    """Average one recording over windows whose rows are all usable and all slide in one direction.

    Arrays have shape ``(n,)``. Force and position are raw. The force is the drive force minus the
    load; it is valid in ``usable`` rows, or in all rows without that mask. The velocity only states
    where the piston slides.
    ``chambers_n``, shape ``(n, 2)``, holds the forces of the oil on piston and rod side.
    """
    mean, first, second = _window(sample_time_s)
    rows, size = len(force_n), len(mean)
    direction = direction_of_motion(velocity_m_s, SLOWEST_M_S)
    if usable is not None:
        direction = np.where(usable, direction, 0.0)
    at = np.arange(size, rows - size, max(1, size // WINDOWS_APART))
    least, greatest = sliding_extremes(direction, size)
    at = at[(least[at] > 0.0) | (greatest[at] < 0.0)]

    def means(values: Array, weights: Array = mean) -> Array:
        return np.asarray(np.convolve(values - values[0], weights, mode="same")[at] + weights.sum() * values[0])

    sides = np.zeros((rows, 2)) if chambers_n is None else chambers_n
    cluster = np.unique(at // max(1, round(CLUSTER_S / sample_time_s)), return_inverse=True)[1]
    return MotionPoints(
        means(force_n),
        means(position_m),
        means(position_m, first),
        means(position_m, second),
        direction[at],
        travel_since_stop(velocity_m_s, SLOWEST_M_S, sample_time_s)[at],
        means(sides[:, 0]),
        means(sides[:, 1]),
        cluster.astype(np.int64),
    )


def _window(sample_time_s: float) -> tuple[Array, Array, Array]:
    """Build the window, which sums to 1, and its two derivatives [1/s, 1/s²].

    Of all windows of its length, it gives white noise of position the least weight in acceleration.
    """
    half = max(3, round(0.5 * WINDOW_S / sample_time_s))
    place = np.arange(-half - 2, half + 3) / (half + 1.0)
    window = np.maximum(1.0 - place**2, 0.0) ** 2
    window /= window.sum()
    first = 0.5 * (window[2:] - window[:-2]) / sample_time_s
    second = (window[2:] - 2.0 * window[1:-1] + window[:-2]) / sample_time_s**2
    return window[1:-1], first, second


def identify_motion(points: MotionPoints, confidence: float = 0.95, load_order: int = 2) -> MotionIdentification:
    """Identify the moving mass of one session, with its interval.

    A polynomial in position of ``load_order`` represents an unknown load.

    Raises:
        RecordingError: There are too few windows in motion.
    """
    late = points.where(points.travel_m >= LATE_M)
    if len(late) < _LEAST_WINDOWS:
        raise RecordingError(
            f"the moving mass cannot be identified: got {len(late)} windows of {WINDOW_S} s that slide more than "
            f"{1e3 * LATE_M:.0f} mm after standstill; expected at least {_LEAST_WINDOWS}; record longer strokes, or "
            "give the mass (label.inertia: given)"
        )
    early = _regressed(points.where(points.travel_m >= EARLY_M), False, confidence, load_order)
    both = early, _regressed(late, True, confidence, load_order)
    low, high = min(each.mass_kg - each.half_kg for each in both), max(each.mass_kg + each.half_kg for each in both)
    mass_kg = 0.5 * (low + high)
    half_kg = 0.5 * (high - low) + early.late_kg
    if points.chamber_1_n.any():
        half_kg += PRESSED * abs(mass_kg)
    return MotionIdentification(mass_kg, (mass_kg - half_kg, mass_kg + half_kg), early.residual_n, confidence)


@dataclass(frozen=True)
class _Regression:
    """The mass in one regression of force on motion."""

    mass_kg: float
    half_kg: float  # Half the confidence interval; infinite with too few clusters [kg]
    residual_n: float  # Root mean square residual [N]
    late_kg: float  # Mass that friction which falls with speed imitates if it is ``LATE_S`` late [kg]


def _regressed(points: MotionPoints, with_lag: bool, confidence: float, load_order: int) -> _Regression:
    """Regress force on acceleration, friction of each direction and a load by position."""
    speed_m_s, acceleration_m_s2 = np.abs(points.velocity_m_s), points.acceleration_m_s2
    of_speed = _of_speed(speed_m_s)
    columns = [acceleration_m_s2]
    for sign in (1.0, -1.0):
        columns += [(points.direction == sign) * each for each in (*of_speed, _other_chamber(points, sign))]
    if with_lag:
        columns.append(acceleration_m_s2 * np.exp(-speed_m_s / LAG_M_S))
    first_m, last_m = float(points.position_m.min()), float(points.position_m.max())
    along = (2.0 * points.position_m - first_m - last_m) / max(last_m - first_m, 1e-12)
    design = np.column_stack([*columns, legendre.legvander(along, load_order)[:, 1:]])
    some = np.any(design != 0.0, axis=0)  # without pressures, or in one direction alone, columns are empty
    fit = robust_fit(design[:, some], points.force_n, _OUTLIER_MULTIPLE)
    cluster = np.unique(points.cluster, return_inverse=True)[1].astype(np.int64)
    half_kg = float(clustered_half_widths(design[:, some], fit, cluster, confidence)[0])
    coefficients = np.zeros(design.shape[1])
    coefficients[some] = fit.coefficients
    of_direction = coefficients[1 : 1 + 2 * (len(of_speed) + 1)].reshape(2, -1)[:, :-1] * [[1.0], [-1.0]]
    around_m_s = speed_m_s + np.array([[-0.5], [0.5]]) * SLOPE_M_S
    slopes_n_s_m = of_direction @ np.diff([_of_speed(each) for each in around_m_s], axis=0)[0] / SLOPE_M_S
    own_n_s_m = np.where(points.direction > 0.0, *slopes_n_s_m)
    viscous_n_s_m = max(float(own_n_s_m[speed_m_s >= np.quantile(speed_m_s, FAST)].mean()), 0.0)
    falls_n_s_m = np.maximum(viscous_n_s_m - own_n_s_m, 0.0)
    late_kg = LATE_S * float(np.average(falls_n_s_m, weights=acceleration_m_s2**2))
    return _Regression(float(fit.coefficients[0]), half_kg, float(np.sqrt(np.mean(fit.residuals**2))), late_kg)


def _of_speed(speed_m_s: Array) -> Array:
    """Compute the terms of friction that depend on speed, shape ``(terms, n)``."""
    fading = np.exp(-speed_m_s / np.array(STRIBECK_M_S)[:, None])
    return np.vstack([np.ones(len(speed_m_s)), speed_m_s, speed_m_s**2, fading])


def _other_chamber(points: MotionPoints, sign: float) -> Array:
    """Return the force of the chamber that does not answer to friction in this direction [N].

    While the drive pushes, the chamber that fills answers; while the load pulls, the other.
    The pressure that answers contains friction itself, so friction must not be explained by it.
    """
    own = points.direction == sign
    pushes = float(np.sum(points.force_n[own])) * sign > 0.0
    return points.chamber_2_n if pushes == (sign > 0.0) else points.chamber_1_n


def missing_mass(labelled: Recording, cylinder: Cylinder) -> str:
    """State it if a label changes with acceleration as a much larger mass would; else empty."""
    stated_kg, usable = cylinder.moving_mass_kg, labelled.usable()
    velocity_m_s, friction_n = map(labelled.column, ("velocity_m_s", "friction_n"))
    step_s = labelled.sample_time_s
    acceleration_m_s2 = np.gradient(velocity_m_s, step_s)
    terms = np.stack([np.sign(velocity_m_s), velocity_m_s, acceleration_m_s2])[:, usable]
    rough_kg = float(np.linalg.lstsq(terms @ terms.T, terms @ friction_n[usable])[0][2])
    if rough_kg < 0.5 * stated_kg:  # as in most recordings: nothing calls for the fit, which takes far longer
        return ""
    force_n, chambers_n = raw_force(labelled, cylinder)
    points = motion_points(force_n, labelled.column("position_m"), velocity_m_s, step_s, usable, chambers_n)
    try:
        found = identify_motion(points)
    except RecordingError:
        return ""
    least_kg, most_kg = (limit - stated_kg for limit in found.mass_interval_kg)
    inertia_n = least_kg * float(np.quantile(np.abs(points.acceleration_m_s2), 0.95))
    if least_kg < stated_kg or inertia_n < _LEAST_SHARE * float(np.mean(np.abs(friction_n[usable]))):
        return ""
    surplus = f"{least_kg:.0f} to {most_kg:.0f} kg more" if found.mass_known else "far more mass"
    return (
        f"friction changes with acceleration as {surplus} than the stated {stated_kg:.4g} kg would; "
        "check moving_mass_kg, which counts what the rod drives too"
    )


def raw_force(recording: Recording, cylinder: Cylinder) -> tuple[Array, Array | None]:
    """Compute the raw drive force minus a known load, and the forces of both chambers [N].

    Without pressures, the chambers' forces are None.

    The recording has ``velocity_m_s``, by which a stated loss of lines is subtracted.
    """
    chambers_n: Array | None = None
    if has_pressures(recording):
        lines = recording.metadata.line_loss
        inside = in_chambers(recording, lines, recording.column("velocity_m_s")) if lines else recording
        areas_m2 = cylinder.piston_area_m2, cylinder.annulus_area_m2
        sides = [inside.column(name) * area for name, area in zip(PRESSURES, areas_m2, strict=True)]
        chambers_n = np.column_stack(sides)
        force_n = sides[0] - sides[1]
    else:
        force_n = recording.column(DRIVE_FORCE)
    return (force_n - recording.column(LOAD_FORCE) if LOAD_FORCE in recording.columns else force_n), chambers_n
