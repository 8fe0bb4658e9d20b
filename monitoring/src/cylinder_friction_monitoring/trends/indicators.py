"""Compute a session's row: indicators with uncertainties, and the covariates that they depend on."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cylinder_friction import Cylinder, Recording
from cylinder_friction_monitoring.arrays import Array
from cylinder_friction_monitoring.errors import MonitoringError
from cylinder_friction_monitoring.trends.blocks import Blocks, session_blocks
from cylinder_friction_monitoring.trends.breakaway import breakaway
from cylinder_friction_monitoring.trends.leak import leak
from cylinder_friction_monitoring.trends.matched_strokes import TENTHS, Matched, matched_strokes
from cylinder_friction_monitoring.trends.plan import IndicatorPlan
from cylinder_friction_monitoring.trends.session_row import Indicator, SessionRow

LEAST_TENTHS = 3  # Number of tenths of the stroke with friction that a profile needs
LEAST_SPREAD = 1.5  # Least ratio of the 90 % to the 10 % quantile of speed for a viscous slope
LEAST_VARIATION = 0.3
"""Least variance of the speeds of a resample that counts, as a share of the variance over all strokes."""
STROKE_POINTS = 60
OTHER_PRESSURES = "pressures differ between the directions: a change of a transmitter's gain would look like friction"


def session_row(
    recordings: Sequence[Recording], cylinder: Cylinder, plan: IndicatorPlan | None = None, name: str = ""
) -> SessionRow:
    """Compute the row of one session from all its recordings, as ``estimate`` writes them.

    ``name`` is the cylinder's name in its fleet, by default its own name. ``MonitoringError`` is raised without
    recordings, and for several sessions.
    """
    plan = plan or IndicatorPlan()
    sessions = sorted({each.metadata.session or each.name for each in recordings})
    if len(sessions) != 1:
        raise MonitoringError(
            f"expected recordings of one session, but got {len(sessions)} ({', '.join(sessions) or 'none'}); make one "
            "row per session"
        )
    blocks = session_blocks(recordings, cylinder, plan)
    matched = matched_strokes(blocks, cylinder, plan)
    first = min(recordings, key=lambda each: (each.metadata.start == "", each.metadata.start))
    return SessionRow(
        cylinder=name or cylinder.name,
        session=sessions[0],
        start=first.metadata.start,
        start_source=first.metadata.start_source,
        duration_s=sum(len(each) * each.sample_time_s for each in recordings),
        indicators={
            **_of_matched(matched, cylinder, plan),
            "breakaway_n": breakaway(recordings, cylinder, plan),
            "leak_m3_s_pa": leak(recordings, cylinder, plan),
        },
        covariates=_covariates(matched, recordings),
        stroke=_strokes(blocks),
    )


def _of_matched(matched: Matched, cylinder: Cylinder, plan: IndicatorPlan) -> dict[str, Indicator]:
    names = ("friction_n", "half_sum_n", "viscous_n_s_m", "profile_n")
    why = ""
    if len(matched) < plan.least_blocks:
        why = (
            f"{len(matched)} blocks of strokes out and back match in speed, position and pressure; "
            f"{plan.least_blocks} are needed; record slow strokes over the same travel in both directions"
        )
    elif min(matched.strokes) < plan.least_strokes:
        out, back = matched.strokes
        why = f"{out} strokes out and {back} back match; {plan.least_strokes} each way are needed"
    if why:
        return {name: Indicator(None, why=why) for name in names}
    level, _ = _line(np.log(matched.means["speed_m_s"]), matched.half_difference_n, matched.weight)
    note = "" if matched.at_pressure else OTHER_PRESSURES
    friction = replace(_spread(level), why=note)
    half_sum = _spread(_mean(matched.half_sum_n, matched.weight))
    return dict(
        zip(names, (friction, half_sum, _viscous(matched, plan), _range(_profile(matched, cylinder))), strict=True)
    )


def _mean(values: Array, weight: Array) -> Array:
    """Average each column with weights; NaN if a resample has no weight."""
    total = weight.sum(axis=0)
    return np.asarray((values * weight).sum(axis=0) / np.where(total > 0.0, total, np.nan))


def _line(at: Array, values: Array, weight: Array) -> tuple[Array, Array]:
    """Fit a line to each column: level at the mean of all strokes, and slope. NaN if a resample varies too little."""
    about = at - np.average(at, weights=weight[:, 0])
    means = _mean(np.broadcast_to(about[:, None], weight.shape), weight)
    centred = about[:, None] - means
    spread = (weight * centred**2).sum(axis=0) / np.maximum(weight.sum(axis=0), 1.0)
    enough = spread >= LEAST_VARIATION * spread[0]
    slope = np.where(enough, _mean(centred * values, weight) / np.where(spread > 0.0, spread, np.inf), np.nan)
    return _mean(values, weight) - slope * means, slope


def _spread(values: Array) -> Indicator:
    drawn = values[1:][np.isfinite(values[1:])]
    return Indicator(float(values[0]), float(drawn.std(ddof=1)) if len(drawn) > 1 else None)


def _viscous(matched: Matched, plan: IndicatorPlan) -> Indicator:
    """Fit the slope of friction against speed beyond the Stribeck curve."""
    speed = matched.means["speed_m_s"]
    fast = speed >= plan.viscous_from_m_s
    low, high = np.quantile(speed[fast], (0.1, 0.9)) if fast.any() else (1.0, 1.0)
    if fast.sum() < plan.least_blocks or high < LEAST_SPREAD * low:
        return Indicator(
            None,
            why=f"matched strokes at {1e3 * low:.0f} to {1e3 * high:.0f} mm/s do not show a slope; record strokes at "
            f"two speeds above {1e3 * plan.viscous_from_m_s:g} mm/s, one {LEAST_SPREAD:g} times the other",
        )
    return _spread(_line(speed[fast], matched.half_difference_n[fast], matched.weight[fast])[1])


def _profile(matched: Matched, cylinder: Cylinder) -> Array:
    """Compute friction by tenth of the stroke at one speed [N], ``(TENTHS, 1 + bootstrap)``; NaN without a match."""
    if not len(matched):
        return np.full((TENTHS, 1), np.nan)
    logs = np.log(matched.means["speed_m_s"])
    slope = np.nan_to_num(_line(logs, matched.half_difference_n, matched.weight)[1])
    at_one_speed = (
        matched.half_difference_n - slope[0] * (logs - np.average(logs, weights=matched.weight[:, 0]))[:, None]
    )
    tenth = np.clip((TENTHS * matched.extending.position_m / cylinder.stroke_m).astype(np.int64), 0, TENTHS - 1)
    return np.array([_mean(at_one_speed[tenth == n], matched.weight[tenth == n]) for n in range(TENTHS)])


def _range(profile: Array) -> Indicator:
    known = np.isfinite(profile[:, 0])
    if known.sum() < LEAST_TENTHS:
        return Indicator(None, why=f"friction is known in {known.sum()} tenths of the stroke, {LEAST_TENTHS} needed")
    own = profile[known]
    complete = own[:, np.isfinite(own).all(axis=0)]
    uncertainty = float((complete.max(axis=0) - complete.min(axis=0)).std(ddof=1)) if complete.shape[1] > 20 else None
    return Indicator(float(own[:, 0].max() - own[:, 0].min()), uncertainty)


def _covariates(matched: Matched, recordings: Sequence[Recording]) -> dict[str, float | None]:
    weight = matched.weight[:, 0]

    def mean(name: str, scale: float = 1.0) -> float | None:
        return _number(scale * float(np.average(matched.means[name], weights=weight))) if len(matched) else None

    logs = np.log(matched.means["speed_m_s"])
    speed_m_s = float(np.exp(np.average(logs, weights=weight))) if len(matched) else None
    return {
        "oil_temperature_c": mean("oil_temperature_c"),
        "pressure_1_bar": mean("pressure_1_pa", 1e-5),
        "pressure_2_bar": mean("pressure_2_pa", 1e-5),
        "speed_m_s": speed_m_s,
        "load_n": mean("load_n"),
        "travel_m": sum(float(np.abs(each.column("velocity_m_s")).sum()) * each.sample_time_s for each in recordings),
    }


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _strokes(blocks: Blocks) -> dict[str, tuple[tuple[float, float], ...]]:
    """Thin the longest stroke in each direction to points of position and force."""
    found: dict[str, tuple[tuple[float, float], ...]] = {}
    for way, sign in (("extend", 1.0), ("retract", -1.0)):
        own = blocks.select(np.sign(blocks.velocity_m_s) == sign)
        if not len(own.stroke):
            continue
        spans = [np.ptp(own.position_m[own.stroke == each]) for each in np.unique(own.stroke)]
        longest = own.select(own.stroke == np.unique(own.stroke)[int(np.argmax(spans))])
        rows = slice(None, None, -(-len(longest.stroke) // STROKE_POINTS))
        found[way] = tuple(zip(longest.position_m[rows].tolist(), longest.force_n[rows].tolist(), strict=True))
    return found
