"""The moving mass and friction, identified from how force and acceleration vary together.

    F_drive - F_load = m·a + s_2·v + F_C·sgn(v) + F_0

Force, velocity and acceleration come from one filter. Before the regression, each column, including the direction's
sign, is averaged over the same short blocks (parallel filtering: Gautier, Janot and Vandanjon 2013). Frequencies that
the filter removes from one signal but not from another lie above the blocks' pass band, so they cause no bias, and
residuals of neighbouring blocks are nearly independent. Noise of the acceleration still biases the mass towards zero,
so choose filter windows that leave the acceleration clean.

A hydraulic cylinder's motion seldom determines its mass: 6 kg at 1 m/s² are 6 N, while friction is hundreds of newtons.
The interval is then wide, and ``mass_known`` is False.
"""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from cylinder_friction.arrays import Array, Mask
from cylinder_friction.labelling.averages import Averages
from cylinder_friction.labelling.robust import clustered_half_widths, robust_fit
from cylinder_friction.recordings.recording import Recording, RecordingError

SLOWEST_M_S = 1e-3
"""Speed below which a row excludes its block, as Coulomb's law ends at sticking [m/s]."""
BLOCK_S, CLUSTER_S = 0.05, 1.0
"""Duration of a block, averaged before the regression, and of a cluster, whose residuals may be correlated [s]."""
_LEAST_BLOCKS = 40
_LEAST_SHARE = 0.1  # Least force of inertia left in a label, over its mean friction, that is worth a word
_OUTLIER_MULTIPLE = 3.0
"""Huber's threshold, wide enough to keep the full weight of friction that is neither Coulomb nor viscous."""


@dataclass(frozen=True)
class MotionPoints(Averages):
    """Means over blocks in motion, each of shape ``(blocks,)``."""

    group = "cluster"

    direction: Array  # Mean sign of velocity
    cluster: NDArray[np.int64]  # Number of the block's cluster of ``CLUSTER_S``, counted from 0


@dataclass(frozen=True)
class MotionIdentification:
    """Coefficients of the regression, each with its confidence interval in the same unit."""

    mass_kg: float  # Moving mass, m [kg]
    mass_interval_kg: tuple[float, float]  # Interval of the mass [kg]
    viscous_n_s_m: float  # Viscous friction, s_2 [N s/m]
    viscous_interval_n_s_m: tuple[float, float]  # Interval of viscous friction [N s/m]
    coulomb_n: float  # Coulomb friction, F_C [N]
    coulomb_interval_n: tuple[float, float]  # Interval of Coulomb friction [N]
    # Constant force, F_0 [N]: a sensor's offset, a difference of friction between the directions, or the mean of a load
    # identified at the same time
    offset_n: float
    offset_interval_n: tuple[float, float]  # Interval of the constant force [N]
    residual_n: float  # Root mean square residual of the blocks [N]
    blocks: int  # Number of blocks in the regression
    confidence: float  # Probability of the intervals

    @property
    def mass_known(self) -> bool:
        """Whether the motion determines the mass: it is positive, and its interval is no wider than the mass."""
        low, high = self.mass_interval_kg
        return self.mass_kg > 0.0 and high - low <= self.mass_kg

    def sentence(self) -> str:
        """State in words whether the motion determines the mass."""
        low, high = self.mass_interval_kg
        found = f"{self.mass_kg:.4g} kg, {100 * self.confidence:g} % interval {low:.4g} to {high:.4g} kg"
        if self.mass_known:
            return f"the moving mass was identified as {found}"
        return f"the motion does not determine the moving mass: got {found}; record faster strokes or give it"

    def to_dict(self) -> dict[str, Any]:
        """Collect the content as JSON-compatible values."""
        return asdict(self) | {"mass_known": self.mass_known, "mass_summary": self.sentence()}


def motion_points(
    force_n: Array,
    position_m: Array,
    velocity_m_s: Array,
    acceleration_m_s2: Array,
    sample_time_s: float,
    usable: Mask | None = None,
    slowest_m_s: float = SLOWEST_M_S,
) -> MotionPoints:
    """Average one recording over blocks whose rows are all usable and all in motion.

    Arrays have shape ``(n,)`` and are smooth. The force is the drive force minus the load; it is valid in ``usable``
    rows, or in all rows without that mask.
    """
    size = max(1, round(BLOCK_S / sample_time_s))
    count = len(force_n) // size

    def pieces(values: NDArray[Any]) -> NDArray[Any]:
        return values[: count * size].reshape(count, size)

    moving = np.abs(velocity_m_s) >= slowest_m_s
    whole = pieces(moving if usable is None else moving & usable).all(axis=1)
    cluster_size = max(1, round(CLUSTER_S / (size * sample_time_s)))
    cluster = np.unique(np.flatnonzero(whole) // cluster_size, return_inverse=True)[1]
    force, position, velocity, acceleration, direction = (
        pieces(values)[whole].mean(axis=1)
        for values in (force_n, position_m, velocity_m_s, acceleration_m_s2, np.sign(velocity_m_s))
    )
    return MotionPoints(force, position, velocity, acceleration, direction, cluster.astype(np.int64))


def identify_motion(points: MotionPoints, confidence: float = 0.95, load_order: int = 0) -> MotionIdentification:
    """Identify mass, viscous friction, Coulomb friction and offset of one session, with their intervals.

    A polynomial in position of ``load_order`` represents an unknown load; its constant is the offset.

    Raises:
        RecordingError: There are too few blocks in motion.
    """
    if len(points) < _LEAST_BLOCKS:
        raise RecordingError(
            f"the moving mass cannot be identified: got {len(points)} blocks of steady motion; expected at "
            f"least {_LEAST_BLOCKS}; record longer strokes, or give the mass (label.inertia: given)"
        )
    first, last = float(points.position_m.min()), float(points.position_m.max())
    along = (2.0 * points.position_m - first - last) / max(last - first, 1e-12)
    motion = np.column_stack([points.acceleration_m_s2, points.velocity_m_s, points.direction])
    design = np.hstack([motion, legendre.legvander(along, load_order)])
    fit = robust_fit(design, points.force_n, _OUTLIER_MULTIPLE)
    half = clustered_half_widths(design, fit, points.cluster, confidence)
    mass, viscous, coulomb, offset = (
        (float(value), (float(value - width), float(value + width)))
        for value, width in zip(fit.coefficients[:4], half[:4], strict=True)
    )
    residual_n = float(np.sqrt(np.mean(fit.residuals**2)))
    return MotionIdentification(*mass, *viscous, *coulomb, *offset, residual_n, len(points), confidence)


def missing_mass(labelled: Recording, stated_kg: float) -> str:
    """State it if a label changes with acceleration as more than ``stated_kg`` of mass left out would; else empty."""
    position_m, velocity_m_s, friction_n = map(labelled.column, ("position_m", "velocity_m_s", "friction_n"))
    step_s, usable = labelled.sample_time_s, labelled.usable()
    acceleration_m_s2 = np.gradient(velocity_m_s, step_s)
    terms = np.stack([np.sign(velocity_m_s), velocity_m_s, acceleration_m_s2])[:, usable]
    rough_kg = float(np.linalg.lstsq(terms @ terms.T, terms @ friction_n[usable])[0][2])
    if rough_kg < 0.5 * stated_kg:  # as in most recordings: nothing calls for the fit, which takes far longer
        return ""
    points = motion_points(friction_n, position_m, velocity_m_s, acceleration_m_s2, step_s, usable)
    if len(points) < _LEAST_BLOCKS:
        return ""
    least_kg, most_kg = identify_motion(points, load_order=2).mass_interval_kg
    inertia_n = least_kg * float(np.quantile(np.abs(points.acceleration_m_s2), 0.95))
    if least_kg < stated_kg or inertia_n < _LEAST_SHARE * float(np.mean(np.abs(friction_n[usable]))):
        return ""
    return (
        f"friction changes with acceleration as {least_kg:.0f} to {most_kg:.0f} kg more than the stated "
        f"{stated_kg:.4g} kg would; check moving_mass_kg, which counts what the rod drives too"
    )
