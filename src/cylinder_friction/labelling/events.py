"""Starts, stops and reversals: where a label is hardest."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.labelling.masks import spread

if TYPE_CHECKING:
    from numpy.typing import NDArray

MOVING_VELOCITY_M_S = 1e-3
"""Slower than this the piston counts as at rest."""

EVENTS = ("start", "stop", "reversal")


def event_masks(velocity_m_s: NDArray[np.float64], window: int) -> dict[str, NDArray[np.bool_]]:
    """Return the rows within ``window`` rows of each kind of event, each mask of shape ``(n,)``.

    A reversal goes from one direction to the other with at most ``window`` rows of rest between; with a longer rest
    it is a stop and a start.

    Args:
        velocity_m_s: True velocity [m/s], shape ``(n,)``: without noise.
        window: Rows before and after an event.
    """
    direction = np.where(np.abs(velocity_m_s) > MOVING_VELOCITY_M_S, np.sign(velocity_m_s), 0.0).astype(np.int64)
    changes = np.flatnonzero(np.diff(direction)) + 1
    marks = {kind: np.zeros(len(direction), dtype=np.bool_) for kind in EVENTS}
    for index, row in enumerate(changes):
        before, now = direction[row - 1], direction[row]
        if now == 0:
            following = changes[index + 1] if index + 1 < len(changes) else None
            turns = following is not None and following - row <= window and direction[following] == -before
            marks["reversal" if turns else "stop"][row] = True
        elif before == 0:
            previous = changes[index - 1] if index > 0 else None
            turned = previous is not None and row - previous <= window and direction[previous - 1] == -now
            marks["reversal" if turned else "start"][row] = True
        else:
            marks["reversal"][row] = True
    return {kind: spread(mark, window, window) for kind, mark in marks.items()}
