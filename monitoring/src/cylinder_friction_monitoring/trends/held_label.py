"""Compute the share of a session's label within a model's bounds, with and without a constant force."""

from collections.abc import Sequence

import numpy as np

from cylinder_friction import Recording
from cylinder_friction.realtime.bounds import bounds_count
from cylinder_friction.signals.motion import direction_of_motion
from cylinder_friction_monitoring.trends.plan import IndicatorPlan
from cylinder_friction_monitoring.trends.session_row import HeldLabel

_COLUMNS = ("label_n", "friction_n", "lower_n", "upper_n", "velocity_m_s")


def held_label(recordings: Sequence[Recording], stated: float) -> HeldLabel | None:
    """Compute the share of a session's label within the bounds; None if no model estimated all its recordings.

    ``bounds_count`` selects the rows. ``stated`` is the share that the bounds should contain.
    """
    models = {each.metadata.depends_on.get("model", "") for each in recordings}
    if len(models) != 1 or "" in models:
        return None
    (model,) = models
    counted = [(each, bounds_count(each)) for each in recordings]
    label_n, friction_n, lower_n, upper_n, velocity_m_s = (
        np.concatenate([each.column(name)[rows] for each, rows in counted]) for name in _COLUMNS
    )
    if not len(label_n):
        return HeldLabel(model, stated, None, None)
    error_n, direction = label_n - friction_n, direction_of_motion(velocity_m_s, IndicatorPlan.slowest_m_s)
    ways = [error_n[direction == sign] for sign in (1.0, -1.0)]
    zero_n = 0.5 * sum(float(np.median(way)) for way in ways) if all(map(len, ways)) else float(np.median(error_n))

    def share(values_n: np.ndarray) -> float:
        return float(np.mean((lower_n <= values_n) & (values_n <= upper_n)))

    return HeldLabel(model, stated, share(label_n), share(label_n - zero_n))
