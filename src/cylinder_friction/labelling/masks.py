"""The rows whose label is friction."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cylinder_friction.signals.motion import widened

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from cylinder_friction.signals.smooth_signals import Support


def usable_rows(
    position_m: NDArray[np.float64], stroke_m: float, margin_m: float, support: Support
) -> NDArray[np.bool_]:
    """Return the mask of usable rows, shape ``(n,)``.

    Not usable: rows within ``margin_m`` of an end stop, whose reaction would be counted as friction; every row whose
    filter's support includes such a row; and the rows at either edge of the recording whose support is incomplete.

    Args:
        position_m: Position [m], shape ``(n,)``, 0 to ``stroke_m``.
        stroke_m: Length of travel [m].
        margin_m: Distance from either end stop [m].
        support: Support of the filter.
    """
    stopped = (position_m <= margin_m) | (position_m >= stroke_m - margin_m)
    usable = ~widened(stopped, before=support.after, after=support.before)
    usable[: support.before] = False
    usable[len(usable) - min(support.after, len(usable)) :] = False
    return usable
