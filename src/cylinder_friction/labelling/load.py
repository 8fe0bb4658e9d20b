"""The load as a smooth function of position, identified from the symmetry of strokes up and down.

What drives the piston less inertia is load plus friction, and friction turns its sign with the direction where the
load at a position does not:

    F_drive - m·a = L(x) + F_C·sgn(v) + s_2·v

L is a polynomial in position, whose order cross-validation chooses; friction is Coulomb and viscous, the same in
both directions, over rows that clearly move. **A difference of friction between the directions that does not depend
on position is indistinguishable from load**: half of it goes into L. How large it may be is therefore stated, as a
share of Coulomb friction, and enters the load's uncertainty beside the scatter of the strokes.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Self

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.labelling.robust import (
    bootstrap_coefficients,
    quantile_interval,
    refuse_no_probability,
    robust_fit,
)
from cylinder_friction.labelling.strokes import StrokePoints, TravelCovered, coverage_of
from cylinder_friction.realtime.position_load import PositionLoad
from cylinder_friction.recordings.columns import COVERAGE_FACTOR
from cylinder_friction.recordings.recording import RecordingError

GRID = 51
"""Positions at which the uncertainty is kept."""
POOLED_PLACES = 129
"""Positions at which the mean load of several sessions is kept."""

_FOLDS = 5
_BLOCKS_PER_DIRECTION = 10
_AS_GOOD = 1.01
"""Cross-validated error of the chosen order over the least one, at most."""
_OWN_SHARE = 0.05
"""Viscous friction is identified if position and direction leave this share of velocity's square unexplained."""
_LEAST_POINTS_PER_COEFFICIENT = 4


@dataclass(frozen=True)
class LoadPlan:
    """How a load is identified.

    Raises:
        ValueError: A number is out of its range.
    """

    slowest_m_s: float = 2e-3  # Slower rows are left out: there friction is neither Coulomb nor viscous [m/s]
    settling_travel_m: float = 2e-3  # Travel after a start or reversal that does not count [m]
    greatest_order: int = 8  # Greatest order of the polynomial in position
    # Standard uncertainty of the difference of friction between the directions, half of it over Coulomb friction; the
    # data cannot determine it
    asymmetry: float = 0.15
    repeats: int = 200  # Bootstrap samples
    seed: int = 0  # Seed of the bootstrap
    confidence: float = 0.95  # Probability of the intervals

    def __post_init__(self) -> None:
        for field in ("slowest_m_s", "settling_travel_m", "asymmetry"):
            value = getattr(self, field)
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"LoadPlan: {field} must be zero or a positive number, but got {value!r}")
        for field, least in (("greatest_order", 0), ("repeats", 20)):
            if getattr(self, field) < least:
                raise ValueError(f"LoadPlan: {field} must be at least {least}, but got {getattr(self, field)!r}")
        refuse_no_probability("LoadPlan", self.confidence)


@dataclass(frozen=True)
class LoadIdentification:
    """A load that depends on position, and the friction found beside it."""

    # Coefficients of Legendre polynomials in position, scaled so that ``range_m`` is -1 to 1 [N]
    coefficients_n: tuple[float, ...]
    coverage: TravelCovered  # Where strokes of both directions went; elsewhere the load is not known
    # Standard uncertainty of the load from the scatter of strokes, at ``GRID`` equidistant positions [N]
    scatter_n: tuple[float, ...]
    asymmetry_n: float  # Standard uncertainty of the load from friction that may differ between the directions [N]
    coulomb_n: float  # Coulomb friction, half the difference between up and down at no speed [N]
    coulomb_interval_n: tuple[float, float]  # Its confidence interval [N]
    # Median residual in either direction after subtracting load and viscous friction [N]; a constant difference between
    # them has gone into the load
    coulomb_extend_n: float
    coulomb_retract_n: float
    viscous_n_s_m: float  # Viscous friction [N s/m]; 0 where the speeds do not determine it
    viscous_interval_n_s_m: tuple[float, float]  # Its confidence interval, then (0, 0)
    load_range_n: tuple[float, float]  # Least and greatest load over the coverage [N]
    # Number of strokes
    strokes_extend: int
    strokes_retract: int
    residual_n: float  # Median absolute residual of the points [N]
    confidence: float  # Probability of the intervals

    @property
    def order(self) -> int:
        """Order of the polynomial."""
        return len(self.coefficients_n) - 1

    def load_n(self, position_m: Array) -> Array:
        """Return the load [N], of the positions' shape; outside the coverage's range that of its nearer end."""
        return np.asarray(legendre.legval(_scaled(position_m, self.coverage), np.array(self.coefficients_n)))

    def uncertainty_n(self, position_m: Array) -> Array:
        """Return the load's standard uncertainty (k = 1) [N], of the positions' shape: scatter and asymmetry."""
        scatter = np.interp(_scaled(position_m, self.coverage), np.linspace(-1.0, 1.0, GRID), np.array(self.scatter_n))
        return np.hypot(scatter, self.asymmetry_n)

    def sentence(self) -> str:
        """Return the result in words."""
        (low_n, high_n), (from_m, to_m) = self.load_range_n, self.coverage.range_m
        return (
            f"the load is {low_n:.0f} to {high_n:.0f} N between {from_m:.3g} and {to_m:.3g} m, from strokes "
            f"({self.strokes_extend} out, {self.strokes_retract} in); Coulomb friction {self.coulomb_n:.4g} N "
            f"({self.coulomb_interval_n[0]:.4g} to {self.coulomb_interval_n[1]:.4g}), "
            f"{self.coulomb_extend_n:.4g} extending and {self.coulomb_retract_n:.4g} retracting"
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the content as JSON-compatible values."""
        content = asdict(self)
        content["range_m"], content["order"] = list(self.coverage.range_m), self.order
        content["stretches_m"] = [list(each) for each in content.pop("coverage")["stretches_m"]]
        return {key: list(value) if isinstance(value, tuple) else value for key, value in sorted(content.items())}

    @classmethod
    def from_dict(cls, content: dict[str, Any]) -> Self:
        """Return what ``to_dict`` gave."""
        kept: dict[str, Any] = {
            key: tuple(value) if isinstance(value, list) else value for key, value in content.items()
        }
        del kept["range_m"], kept["order"]
        return cls(coverage=TravelCovered(tuple(map(tuple, kept.pop("stretches_m")))), **kept)


def identify_load(points: StrokePoints, plan: LoadPlan) -> LoadIdentification:
    """Return the load identified from the strokes of one session, their force less inertia.

    Raises:
        RecordingError: Strokes of both directions do not overlap, or there are too few points.
    """
    coverage = coverage_of(points)
    points = points.where(coverage.holds(points.position_m))
    if len(points) < _LEAST_POINTS_PER_COEFFICIENT * 3:
        raise RecordingError(
            f"load and friction cannot be separated: got {len(points)} points of 0.1 s where strokes of both "
            f"directions overlap; expected at least {_LEAST_POINTS_PER_COEFFICIENT * 3}; record slower or more "
            "strokes, or measure the load"
        )
    direction = np.sign(points.velocity_m_s)
    blocks, groups = _blocks(points, direction)
    order = _order(points, coverage, blocks, plan)
    shape = _polynomials(points.position_m, coverage, order)
    design = np.column_stack([shape, direction, points.velocity_m_s])
    fit = robust_fit(design, points.force_n)
    drawn = bootstrap_coefficients(design, fit, points.force_n, blocks, groups, plan.repeats, plan.seed)
    viscous_interval = quantile_interval(drawn[:, -1], plan.confidence)
    if viscous_interval[0] <= 0.0 or _own_share(design) < _OWN_SHARE:
        design, viscous_interval = design[:, :-1], (0.0, 0.0)
        fit = robust_fit(design, points.force_n)
        drawn = bootstrap_coefficients(design, fit, points.force_n, blocks, groups, plan.repeats, plan.seed)
    viscous = float(fit.coefficients[order + 2]) if design.shape[1] > order + 2 else 0.0
    coulomb = float(fit.coefficients[order + 1])
    if coulomb <= 0.0:
        raise RecordingError(
            f"load and friction cannot be separated: Coulomb friction would be {coulomb:.4g} N, which drives the "
            "motion; check the sign of position and of the forces in the mapping"
        )
    grid = np.linspace(*coverage.range_m, GRID)
    along = _polynomials(grid, coverage, order)
    dry_n = points.force_n - shape @ fit.coefficients[: order + 1] - viscous * points.velocity_m_s
    loads = (along @ fit.coefficients[: order + 1])[coverage.holds(grid)]
    return LoadIdentification(
        coefficients_n=tuple(float(value) for value in fit.coefficients[: order + 1]),
        coverage=coverage,
        scatter_n=tuple(float(value) for value in np.std(drawn[:, : order + 1] @ along.T, axis=0)),
        asymmetry_n=plan.asymmetry * coulomb,
        coulomb_n=coulomb,
        coulomb_interval_n=quantile_interval(drawn[:, order + 1], plan.confidence),
        coulomb_extend_n=float(np.median(dry_n[direction > 0.0])),
        coulomb_retract_n=float(-np.median(dry_n[direction < 0.0])),
        viscous_n_s_m=viscous,
        viscous_interval_n_s_m=viscous_interval,
        load_range_n=(float(loads.min()), float(loads.max())),
        strokes_extend=len(np.unique(points.stroke[direction > 0.0])),
        strokes_retract=len(np.unique(points.stroke[direction < 0.0])),
        residual_n=float(np.median(np.abs(fit.residuals))),
        confidence=plan.confidence,
    )


def pooled_load(sessions: Sequence[LoadIdentification]) -> PositionLoad:
    """Return the mean load of sessions, over the positions that all of them know: what an estimator takes off.

    Its uncertainty is that of one more session: the spread between sessions (of two or more) and what each session's
    load is uncertain by itself.

    Raises:
        RecordingError: There is no session, or they share no stretch of position.
    """
    if not sessions:
        raise RecordingError("a load that depends on position cannot be pooled: got no session; expected at least one")
    firsts, lasts = zip(*(each.coverage.range_m for each in sessions), strict=True)
    first_m, last_m = max(firsts), min(lasts)
    if not first_m < last_m:
        raise RecordingError(
            f"the sessions' loads share no position: one is known from {first_m:.4g} m on, one up to {last_m:.4g} m; "
            "record strokes over the same travel in each session"
        )
    position_m = np.linspace(first_m, last_m, POOLED_PLACES)
    loads_n = np.array([each.load_n(position_m) for each in sessions])
    own_n = np.sqrt(np.mean([each.uncertainty_n(position_m) ** 2 for each in sessions], axis=0))
    spread_n = loads_n.std(axis=0, ddof=1) if len(sessions) > 1 else np.zeros(POOLED_PLACES)
    return PositionLoad(first_m, last_m, loads_n.mean(axis=0), np.hypot(own_n, spread_n))


def refuse_unlike_loads(sessions: Mapping[str, LoadIdentification], common: PositionLoad) -> None:
    """Refuse sessions that cannot all carry the common load.

    Raises:
        RecordingError: The load of a session is further from it than twice its own standard uncertainty.
    """
    position_m = np.linspace(common.first_m, common.last_m, POOLED_PLACES)
    for name, each in sessions.items():
        off_n, known_n = each.load_n(position_m) - common.at(position_m), each.uncertainty_n(position_m)
        if np.sqrt(np.mean(np.square(off_n / known_n))) > COVERAGE_FACTOR:
            raise RecordingError(
                f"sessions carry different loads: that of {name} is {np.sqrt(np.mean(off_n**2)):.3g} N from the mean "
                f"of the training sessions, known to {known_n.mean():.3g} N; expected at most {COVERAGE_FACTOR:g} "
                "times that; set offset.common_load to false, so that each session keeps its own"
            )


def _scaled(position_m: Array, coverage: TravelCovered) -> Array:
    first, last = coverage.range_m
    return np.clip(2.0 * (np.asarray(position_m) - first) / (last - first) - 1.0, -1.0, 1.0)


def _polynomials(position_m: Array, coverage: TravelCovered, order: int) -> Array:
    return np.asarray(legendre.legvander(_scaled(position_m, coverage), order))


def _own_share(design: Array) -> float:
    """Return the share of velocity's square, the last column, that position and direction do not explain.

    Where all strokes of a direction have one speed, it is nearly zero: viscous friction is then indistinguishable from
    Coulomb friction and, where the directions differ in speed, from a constant load.
    """
    others, velocity = design[:, :-1], design[:, -1]
    residual = velocity - others @ np.linalg.lstsq(others, velocity, rcond=None)[0]
    return float(residual @ residual / (velocity @ velocity))


def _blocks(points: StrokePoints, direction: Array) -> tuple[NDArray[np.int64], Array]:
    """Return the block of each point and the direction of each block.

    A stroke is a block, but where one direction has few strokes they are cut, so that each direction has about
    ``_BLOCKS_PER_DIRECTION`` blocks or more.
    """
    piece = np.zeros(len(points), dtype=np.int64)
    for each in (-1.0, 1.0):
        own = np.flatnonzero(direction == each)
        longest = max(1, math.ceil(len(own) / _BLOCKS_PER_DIRECTION))
        stroke = points.stroke[own]
        piece[own] = (np.arange(len(own)) - np.searchsorted(stroke, stroke, side="left")) // longest
    keys = np.stack([points.stroke, piece])
    _, first, blocks = np.unique(keys, axis=1, return_index=True, return_inverse=True)
    return blocks.astype(np.int64).ravel(), direction[first]


def _order(points: StrokePoints, coverage: TravelCovered, blocks: NDArray[np.int64], plan: LoadPlan) -> int:
    """Return the least order that predicts left-out blocks as well as the best one does, within a hundredth."""
    direction = np.sign(points.velocity_m_s)
    greatest = min(plan.greatest_order, len(points) // _LEAST_POINTS_PER_COEFFICIENT - 2)
    fold = blocks % _FOLDS
    errors = []
    for order in range(max(greatest, 0) + 1):
        design = np.column_stack([_polynomials(points.position_m, coverage, order), direction, points.velocity_m_s])
        total = 0.0
        for each in range(_FOLDS):
            out = fold == each
            if out.any() and not out.all():
                fit = robust_fit(design[~out], points.force_n[~out])
                total += float(np.abs(points.force_n[out] - design[out] @ fit.coefficients).sum())
        errors.append(total)
    return next(order for order, error in enumerate(errors) if error <= _AS_GOOD * min(errors))
