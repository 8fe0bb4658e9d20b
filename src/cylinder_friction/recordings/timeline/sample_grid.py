"""Which sample each stamp belongs to: the step of a clock, and how many samples were lost between two stamps."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.recordings.timeline.clock import explaining_resolution, follows_even_clock, whole_hertz

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cylinder_friction.recordings.timeline.time_rules import TimeRules

    Array = NDArray[np.float64]
    Indices = NDArray[np.int64]
    Mask = NDArray[np.bool_]

SHORT_BLOCK = 32
"""Samples over which the step is taken where the stamps' rounding hides it from step to step."""


@dataclass(frozen=True)
class Grid:
    """Sample numbers of the stamps.

    Attributes:
        step_s: Time between two samples [s].
        even: Whether the stamps lie on an even clock, lost samples left aside; else they are uneven and their step is
            the median one.
        index: Sample number of each stamp, shape ``(n,)``; it says nothing across a gap or a restart.
        gaps: Whether more than the samples that may be bridged is lost, or the clock restarts, between a stamp and the
            next, shape ``(n - 1,)``.
    """

    step_s: float
    even: bool
    index: Indices
    gaps: Mask


def find_grid(time_s: Array, segments: Indices, rules: TimeRules) -> Grid:
    """Return the grid of stamps that increase within each segment, shape ``(n,)``, ``n`` at least 2."""
    steps_s = np.diff(time_s)
    restarts = np.diff(segments) != 0
    usual_s = float(np.median(steps_s[~restarts])) if not restarts.all() else 1.0
    candidates = [usual_s]
    averaged_s = _averaged_step(time_s, restarts)
    if averaged_s is not None:
        candidates.append(averaged_s)
    for step_s in candidates:
        grid = _even_grid(time_s, steps_s, restarts, step_s, rules)
        if grid is not None:
            return grid
    return _numbered(steps_s, restarts, _uneven_step(steps_s[~restarts], usual_s), rules, even=False)


def _uneven_step(steps_s: Array, usual_s: float) -> float:
    """Return the median of the steps over which no sample was lost: with the others, 2 % lost make 199 Hz of 200."""
    single = steps_s[np.rint(steps_s / usual_s) == 1.0] if usual_s > 0.0 else steps_s[:0]
    return float(np.median(single)) if len(single) else usual_s


def _averaged_step(time_s: Array, restarts: Mask) -> float | None:
    """Return the median step over short blocks, in which the rounding of 3, 3, 4 ms averages out."""
    block = min(SHORT_BLOCK, len(time_s) // 4)
    if block < 2:
        return None
    restarted = np.concatenate([[0], np.cumsum(restarts)])
    inside = restarted[block:] == restarted[:-block]
    slopes_s = (time_s[block:] - time_s[:-block])[inside] / block
    return float(np.median(slopes_s)) if len(slopes_s) else None


def _numbered(steps_s: Array, restarts: Mask, step_s: float, rules: TimeRules, *, even: bool) -> Grid:
    samples = np.maximum(np.rint(steps_s / step_s), 1.0)
    gaps = restarts | (samples > rules.longest_bridge_samples + 1)
    # A gap is as long as it is: numbers go on as if it were one, so that none grows out of bounds.
    samples[gaps] = rules.longest_bridge_samples + 2
    index = np.concatenate([[0], np.cumsum(samples)]).astype(np.int64)
    return Grid(step_s, even, index, gaps)


def _even_grid(time_s: Array, steps_s: Array, restarts: Mask, step_s: float, rules: TimeRules) -> Grid | None:
    grid = _numbered(steps_s, restarts, step_s, rules, even=True)
    run = ~grid.gaps
    samples = np.diff(grid.index)[run]
    if not run.any():
        return None
    mean_s = float(steps_s[run].sum()) / float(samples.sum())
    resolution_s = explaining_resolution(time_s, mean_s)
    tolerance_s = max(rules.jitter_share * mean_s, 1.05 * resolution_s)
    bounds = np.concatenate([[0], np.flatnonzero(grid.gaps) + 1, [len(time_s)]])
    for start, end in pairwise(bounds):
        if end - start > 1 and not follows_even_clock(time_s[start:end], grid.index[start:end], mean_s, tolerance_s):
            return None
    step_s = 1.0 / whole_hertz(1.0 / mean_s, resolution_s / float(steps_s[run].sum()))
    return Grid(step_s, True, grid.index, grid.gaps)
