"""Match strokes out and back in speed, position and pressure; half their difference is friction.

Half the sum contains forces independent of the direction: the sensors' zeros, the load, and friction's asymmetry.
"""

from dataclasses import dataclass

import numpy as np

from cylinder_friction import Cylinder
from cylinder_friction_monitoring.arrays import Array
from cylinder_friction_monitoring.trends.blocks import Blocks
from cylinder_friction_monitoring.trends.plan import IndicatorPlan

TENTHS = 10
MOST_BLOCKS = 600  # Most blocks of a direction that are used, evenly spread
_SEED = 20
_BAR_PA = 1e5


@dataclass(frozen=True)
class Matched:
    """Extending blocks, each with the mean of the retracting blocks that match it.

    Arrays have shape ``(matches, 1 + bootstrap)``: column 0 is for all strokes, each other column for one resample. A
    block has the weight 0 if a resample lacks its stroke or its match.
    """

    half_difference_n: Array
    half_sum_n: Array
    weight: Array
    extending: Blocks  # Shape ``(matches,)``
    # Means of extending and matching retracting blocks, shape ``(matches,)``; keys as in ``Blocks``
    means: dict[str, Array]
    strokes: tuple[int, int]  # Number of extending and of retracting strokes that match
    at_pressure: bool  # Whether pressures match too; otherwise a transmitter's gain looks like friction

    def __len__(self) -> int:
        return len(self.weight)


def matched_strokes(blocks: Blocks, cylinder: Cylinder, plan: IndicatorPlan) -> Matched:
    """Match blocks out and back, and resample strokes, because the blocks of a stroke share its error."""
    out, back = (_some(blocks, sign) for sign in (1.0, -1.0))
    alike, pressure = _kernels(out, back, cylinder, plan)
    at_pressure = int((alike * pressure).any(axis=1).sum()) >= plan.least_blocks
    kernel = alike * pressure if at_pressure else alike
    rows, columns = np.flatnonzero(kernel.any(axis=1)), np.flatnonzero(kernel.any(axis=0))
    out, back, kernel = out.select(rows), back.select(columns), kernel[np.ix_(rows, columns)]
    generator = np.random.default_rng(_SEED)
    times_out, times_back = (_resampled(each, generator, plan.bootstrap) for each in (out, back))
    total = kernel @ times_back
    known = (times_out > 0.0) & (total > 0.0)
    retracting_n = (kernel @ (times_back * back.force_n[:, None])) / np.where(known, total, np.inf)
    even = kernel / kernel.sum(axis=1, keepdims=True) if len(out.force_n) else kernel
    names = ("mean_pressure_pa", "pressure_1_pa", "pressure_2_pa", "oil_temperature_c", "load_n")
    means = {name: 0.5 * (getattr(out, name) + even @ getattr(back, name)) for name in names}
    means["speed_m_s"] = 0.5 * (np.abs(out.velocity_m_s) + even @ np.abs(back.velocity_m_s))
    return Matched(
        half_difference_n=0.5 * (out.force_n[:, None] - retracting_n),
        half_sum_n=0.5 * (out.force_n[:, None] + retracting_n),
        weight=np.where(known, times_out, 0.0),
        extending=out,
        means=means,
        strokes=(len(np.unique(out.stroke)), len(np.unique(back.stroke))),
        at_pressure=at_pressure,
    )


def _some(blocks: Blocks, sign: float) -> Blocks:
    rows = np.flatnonzero(np.sign(blocks.velocity_m_s) == sign)
    return blocks.select(rows[:: -(-len(rows) // MOST_BLOCKS) or 1])


def _kernels(out: Blocks, back: Blocks, cylinder: Cylinder, plan: IndicatorPlan) -> tuple[Array, Array]:
    """Rate how well blocks match in position and speed, and in pressure: 1 if equal, 0 beyond the plan's distance.

    Both have shape ``(out, back)``.
    """

    def alike(own: Array, other: Array, scale: Array | float) -> Array:
        return np.maximum(1.0 - np.abs(own[:, None] - other[None, :]) / scale, 0.0)

    position = alike(out.position_m, back.position_m, plan.match_position * cylinder.stroke_m)
    speed = alike(np.log(np.abs(out.velocity_m_s)), np.log(np.abs(back.velocity_m_s)), np.log1p(plan.match_speed))
    level = 0.5 * (out.mean_pressure_pa[:, None] + back.mean_pressure_pa[None, :])
    if not np.isfinite(level).all():
        return position * speed, np.ones_like(position)
    scale = np.maximum(plan.match_pressure * level, plan.match_bar * _BAR_PA)
    return position * speed, alike(out.mean_pressure_pa, back.mean_pressure_pa, scale)


def _resampled(blocks: Blocks, generator: np.random.Generator, times: int) -> Array:
    """Count each block once, then as often as each resample draws its stroke, shape ``(blocks, 1 + times)``."""
    names, place = np.unique(blocks.stroke, return_inverse=True)
    if not len(names):
        return np.ones((0, 1 + times))
    drawn = generator.multinomial(len(names), np.full(len(names), 1.0 / len(names)), times).T
    return np.hstack([np.ones((len(place), 1)), drawn[place]])
