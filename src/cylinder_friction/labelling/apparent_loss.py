"""Friction that grows so much with speed that it may be a loss between pressure sensors and cylinder."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.labelling.known_offset import OffsetEvidence, highest_speed, offset_evidence
from cylinder_friction.labelling.robust import robust_fit
from cylinder_friction.labelling.sliding_blocks import OffsetPlan, SlidingBlocks
from cylinder_friction.recordings.columns import PRESSURES
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.wording import four_digits

LEAST_SHARE = 0.75
"""A force that grows with speed is reported if it exceeds this share of mean friction at the highest speed. The part of
friction itself that grows stays below. The part that grows with the square of speed is too uncertain to decide by."""
LEAST_MISSING = 0.25
"""Share of a stated loss, and of friction, above which what still grows with the square of speed is named."""
STRIBECK_SPEEDS_M_S = (0.003, 0.006, 0.012, 0.025)
MOST_SESSIONS = 12
LEAST_BLOCKS = 30
MARGIN = 1.1
"""Factor by which a loss may be larger than it looks."""
_PRESSURE_POWER = 0.8
_RIDGE = 1e-13
"""Share that keeps equations solvable if strokes of one direction cannot tell an offset from Coulomb friction."""


@dataclass(frozen=True)
class ApparentLoss:
    """A force against motion that grows with speed, as a loss in a line between sensors and cylinder would."""

    square_n: float  # Part that grows with the square of speed, at ``speed_m_s`` [N]
    linear_n: float  # Part that grows with speed, at ``speed_m_s`` [N]; includes viscous friction
    friction_n: float  # Mean friction without ``square_n`` [N]
    speed_m_s: float  # Highest speed of steady sliding [m/s]

    unknown_viscous = "part of it may be what lines between sensors and cylinder lose; state sensor.line_loss"

    def most_n(self, velocity_m_s: Array) -> Array:
        """Compute the largest possible loss [N], shape ``(n,)``, as if none of the force were friction."""
        part = np.abs(velocity_m_s) / self.speed_m_s
        return np.asarray(MARGIN * part * (self.square_n * part + self.linear_n))

    def sentence(self, cylinder: Cylinder) -> str:
        """Describe the force and what to do about it."""
        ratio = cylinder.annulus_area_m2 / cylinder.piston_area_m2
        growing_n = self.square_n + self.linear_n
        lost_bar = 1e-5 * growing_n / (cylinder.piston_area_m2 * (1.0 + ratio**3))
        return (
            f"{four_digits(growing_n)} N of the force against motion at {self.speed_m_s:.2g} m/s grow with speed: "
            "viscous friction of the cylinder, or what lines between sensors and cylinder lose, such as "
            f"{lost_bar:.2g} bar (piston side) and {lost_bar * ratio**2:.2g} bar (rod side); strokes cannot tell "
            "which. State sensor.line_loss in the mapping, {bar: 0} if the sensors are at the cylinder's ports; until "
            "then any bounds are wider by what lines may lose, and Coulomb and viscous friction are not known"
        )


def named_loss(evidence: Sequence[OffsetEvidence]) -> ApparentLoss | None:
    """Fit the force that looks like a loss in steady sliding: the median over conditions.

    Returns None without pressures, with too little sliding, if the losses of lines are stated, or if the force is no
    larger than the part of friction that itself grows with speed. In the fit, friction of each condition has Coulomb,
    Stribeck, viscous and pressure-dependent parts, none of them negative, and each session has an offset.
    """
    loss = _growing([each for each in evidence if not each.lines_stated])
    return loss if loss and loss.square_n + loss.linear_n > LEAST_SHARE * loss.friction_n else None


def missing_loss(evidence: Sequence[OffsetEvidence]) -> str:
    """Describe by how much the stated losses of lines are too small; empty unless strokes show that clearly.

    What still grows with the square of speed is compared with the stated loss, at the highest speed of sliding.
    """
    stated = [each for each in evidence if each.stated_loss_n > 0.0]
    left = _growing(stated)
    if left is None:
        return ""
    highest_m_s = np.array([highest_speed(np.abs(each.sliding.columns["velocity_m_s"])) for each in stated])
    own = np.array([(each.stated_loss_n, each.stated_loss_bar) for each in stated])
    stated_n, bar = np.median(own * (left.speed_m_s / highest_m_s[:, None]) ** 2, axis=0).tolist()
    if left.square_n < LEAST_MISSING * max(stated_n, left.friction_n):
        return ""
    return (
        f"the stated losses of lines are too small: what you stated explains {bar:.2g} of about "
        f"{bar * (1.0 + left.square_n / stated_n):.2g} bar (piston side) at {left.speed_m_s:.2g} m/s, if friction does "
        "not grow with the square of speed; correct sensor.line_loss, or its uncertainty_percent"
    )


def _growing(evidence: Sequence[OffsetEvidence]) -> ApparentLoss | None:
    """Fit the force that grows with speed: the median over conditions; None with too little sliding."""
    conditions: dict[str, dict[str, list[SlidingBlocks]]] = {}
    for each in evidence:
        if set(PRESSURES) <= set(each.sliding.columns):
            conditions.setdefault(each.condition, {}).setdefault(each.session, []).append(each.sliding)
    found = []
    for sessions in conditions.values():
        own = list(sessions.values())[:: -(-len(sessions) // MOST_SESSIONS)]
        blocks = [SlidingBlocks.together(parts) for parts in own]
        blocks = [each for each in blocks if len(each.direction)]
        if sum(len(each.direction) for each in blocks) >= LEAST_BLOCKS:
            found.append(_fitted(blocks))
    if not found:
        return None
    square, linear, friction_n, speed = np.median(found, axis=0).tolist()
    return ApparentLoss(square * speed**2, linear * speed, friction_n, speed)


def loss_of_labels(labelled: Sequence[Recording], cylinder: Cylinder) -> ApparentLoss | None:
    """Compute ``named_loss`` from labelled recordings."""
    return named_loss([offset_evidence(each, cylinder, OffsetPlan(), math.nan, math.nan, "") for each in labelled])


def _fitted(sessions: Sequence[SlidingBlocks]) -> tuple[float, float, float, float]:
    """Fit the sessions of one condition by least squares, with Huber's weights and no negative term.

    Returns the force per squared speed and per speed, and the other numbers of ``ApparentLoss``.
    """
    blocks, counts = SlidingBlocks.together(sessions), [len(each.stroke) for each in sessions]
    session = np.repeat(np.arange(len(sessions)), counts)
    direction, speed = blocks.direction, np.abs(blocks.columns["velocity_m_s"])
    highest = highest_speed(speed)
    part = speed / highest
    mean_bar = 0.5e-5 * sum(np.maximum(blocks.columns[name], 0.0) for name in PRESSURES)
    offsets = direction[:, None] * np.eye(len(sessions))[session]
    known = np.column_stack([np.ones_like(part), mean_bar**_PRESSURE_POWER, part, part**2])
    against_n = blocks.label_n * direction
    fits = []
    for stribeck_m_s in STRIBECK_SPEEDS_M_S:
        design = np.column_stack([offsets, np.exp(-speed / stribeck_m_s), known])
        fit = robust_fit(design, against_n, solve=partial(not_negative, free=len(sessions)))
        fits.append((float(np.abs(fit.residuals).sum()), *fit.coefficients[-2:].tolist()))
    _, linear_n, square_n = min(fits)
    friction_n = float(np.mean(np.abs(against_n - square_n * part**2)))
    return square_n / highest**2, linear_n / highest, friction_n, highest


def not_negative(design: Array, target: Array, free: int) -> Array:
    """Solve least squares with no negative coefficient behind the first ``free`` ones.

    One subset of the others is the solution, so all are tried. ``scipy.optimize.nnls`` does more, but takes longer to
    import than most logs take to label.
    """
    chosen = np.array([(1.0,) * free + others for others in product((1.0, 0.0), repeat=design.shape[1] - free)])
    normal, moment, own = design.T @ design, design.T @ target, np.eye(design.shape[1])
    normal += _RIDGE * np.trace(normal) * own
    normal = chosen[:, :, None] * normal * chosen[:, None, :] + (1.0 - chosen)[:, :, None] * own
    found = np.linalg.solve(normal, (chosen * moment)[:, :, None])[:, :, 0]
    return max(found[(found[:, free:] >= 0.0).all(axis=1)], key=lambda each: float(moment @ each))
