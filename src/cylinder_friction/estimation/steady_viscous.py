"""Viscous friction from steady sliding, told from everything else that changes friction along with speed."""

from collections.abc import Sequence

import numpy as np

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.labelling.apparent_loss import STRIBECK_SPEEDS_M_S
from cylinder_friction.labelling.robust import clustered_half_widths, robust_fit
from cylinder_friction.labelling.sliding_blocks import SlidingBlocks, sliding_blocks
from cylinder_friction.recordings.columns import PRESSURES
from cylinder_friction.recordings.recording import Recording

NO_FALL_M_S = 1e-4
"""A Stribeck velocity so low that dry friction does not fall at the speeds of steady sliding."""
ALIKE = 1.05
"""Largest ratio of an error to the least one at which another Stribeck velocity describes friction as well."""


def viscous_interval(recordings: Sequence[Recording], cylinder: Cylinder, confidence: float) -> tuple[float, float]:
    """Compute the confidence interval of viscous friction [N s/m] from labelled recordings.

    In the fit, dry friction may fall with speed and change with pressure, in each direction in its own way, and each
    recording has its own level. Pressure is that of the side that the oil leaves, as the other one contains friction.
    Blocks of a stroke count as one. What strokes do not tell apart widens the interval, which is infinite without
    enough strokes.
    """
    parts = [sliding_blocks(each, cylinder, prior_n=0.0) for each in recordings]
    blocks = SlidingBlocks.together(parts)
    way, speed = blocks.direction, np.abs(blocks.columns["velocity_m_s"])
    if not len(way):
        return -np.inf, np.inf
    part = np.repeat(np.arange(len(parts)), [len(each.stroke) for each in parts])
    levels = (2 * part + (way > 0.0))[:, None] == np.arange(2 * len(parts))
    known = [speed, *levels[:, levels.any(axis=0)].T]
    if set(PRESSURES) <= blocks.columns.keys():
        piston_bar, rod_bar = (1e-5 * blocks.columns[name] for name in PRESSURES)
        known += [np.where(way > 0.0, rod_bar, 0.0), np.where(way < 0.0, piston_bar, 0.0)]
    strokes, fits = np.unique(blocks.stroke, return_inverse=True)[1].astype(np.int64), []
    for stribeck_m_s in (NO_FALL_M_S, *STRIBECK_SPEEDS_M_S):
        design = np.column_stack([*known, np.exp(-speed / stribeck_m_s)])
        fit = robust_fit(design, blocks.label_n * way)
        half = float(clustered_half_widths(design, fit, strokes, confidence)[0])
        fits.append((float(np.abs(fit.residuals).sum()), float(fit.coefficients[0]), half))
    alike = [(value - half, value + half) for error, value, half in fits if error <= ALIKE * min(fits)[0]]
    return min(lower for lower, _ in alike), max(upper for _, upper in alike)
