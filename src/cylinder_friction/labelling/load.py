"""The load as a smooth function of positions, identified from the symmetry of strokes up and down.

The driving force minus inertia is load plus friction. Friction changes its sign with the direction; the load at a
position does not:

    F_drive - m·a = L(x) + F_C·sgn(v) + s_2·v + k·v·abs(v)

L is a polynomial in position, and in the positions of other cylinders if it depends on them; cross-validation chooses
its orders. Only rows that clearly move count, and friction is assumed equal in both directions. It has Coulomb and
viscous terms, and a quadratic term for lines between sensors and cylinder that lose pressure, each if strokes determine
it. **A difference of friction between the directions that does not depend on position cannot be told from load**: half
of it goes into L. Its size is therefore stated, as a share of friction, and adds to the load's uncertainty from the
scatter of the strokes. So does the difference that pressure makes: if it is higher in one direction, as under a
weight, friction of the seals is too, and strokes do not show whether all of friction grows with pressure or none.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from cylinder_friction.arrays import Array, Mask
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.labelling.robust import RobustFit, clustered_covariance, clustered_half_widths, robust_fit
from cylinder_friction.labelling.sliding_blocks import zero_uncertainty_n
from cylinder_friction.labelling.strokes import Covered, StrokePoints, covered
from cylinder_friction.recordings.columns import COVERAGE_FACTOR, POSITION
from cylinder_friction.recordings.line_loss import RECTANGULAR
from cylinder_friction.recordings.recording import Recording, RecordingError
from cylinder_friction.wording import counted

GRID = 51
"""Number of positions at which the uncertainty is stored."""
OTHER_REACH_M = 0.01
"""Largest distance between another cylinder's position and its position in the strokes at which the load holds [m]."""
GREATEST_ORDER, GREATEST_OTHER_ORDER = 8, 1
"""Greatest orders of the polynomial in position and in each of the other positions."""
CONFIDENCE = 0.95
"""Probability of the intervals."""
MOST_SCATTER = 0.2
"""Uncertainty of the load, as a share of Coulomb friction, above which the load counts as unknown."""
LEAST_SPREAD = 0.25
"""Least independent motion of another position for a load that depends on it: the root mean square deviation from a
function of the piston's position, over ``OTHER_REACH_M``. With less, a lag between the two positions turns with the
direction and looks like load."""

_FOLDS = 5
_BLOCKS_PER_DIRECTION = 10
_AS_GOOD = 1.01
"""Largest ratio of a chosen model's error to the least error."""
_ALIKE = 1.1
"""Factor on the least residual up to which another set of speed terms describes friction equally well. The difference
of Coulomb friction between such sets is part of its uncertainty. If other terms describe friction better but strokes do
not determine them, the change that they make to the load is part of the load's uncertainty."""
_OWN_SHARE = 0.05
"""Least share of velocity's square that position and direction must leave unexplained to identify viscous friction."""
_FOLLOWS_PRESSURE = 0.5
"""Standard uncertainty of the share of friction that grows with pressure: none of it to all of it at k = 2."""
_LEAST_POINTS_PER_COEFFICIENT = 4


@dataclass(frozen=True)
class LoadPlan:
    """Settings for the identification of a load from strokes.

    The defaults suit a bench with some hundred newtons of friction. ``asymmetry`` limits the accuracy: strokes cannot
    show it, so state what you know of the seals.

    Raises:
        ValueError: A number is out of its range.
    """

    slowest_m_s: float = 2e-3  # Least speed [m/s]; below it, friction is neither Coulomb nor viscous
    settling_travel_m: float = 2e-3  # Travel after a start or reversal that is ignored [m]
    # Standard uncertainty of the asymmetry, which the data cannot determine: half the difference of friction between
    # the directions, over Coulomb friction, at equal pressures
    asymmetry: float = 0.15

    def __post_init__(self) -> None:
        for field in ("slowest_m_s", "settling_travel_m", "asymmetry"):
            value = getattr(self, field)
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"LoadPlan: {field} must be zero or a positive number, but got {value!r}")


@dataclass(frozen=True)
class LoadIdentification:
    """A load that depends on position, identified from one session, and the Coulomb friction identified with it.

    ``load_n`` computes the load, positive if it resists extension, and ``uncertainty_n`` its standard uncertainty, both
    in newtons. Outside ``coverage`` the load is unknown.
    """

    coefficients_n: tuple[float, ...]  # Coefficients of Legendre polynomials in position [N]
    range_m: tuple[float, float]  # Positions that are -1 and 1 in these polynomials [m]
    coverage: Covered  # Positions with strokes in both directions; elsewhere the load is unknown
    # Standard uncertainty of the load from the scatter of strokes, at ``GRID`` equidistant positions [N]
    scatter_n: tuple[float, ...]
    asymmetry_n: float  # Standard uncertainty of the load from friction that may differ between the directions [N]
    coulomb_n: float  # Coulomb friction: half the difference between up and down, extrapolated to zero speed [N]
    coulomb_interval_n: tuple[float, float]  # Confidence interval of Coulomb friction [N]
    load_range_n: tuple[float, float]  # Least and greatest load over the coverage [N]
    # Number of strokes
    strokes_extend: int
    strokes_retract: int
    others: tuple[str, ...] = ()  # Columns of the other positions that the load depends on
    other_order: int = 0  # Greatest order of the polynomial in each of the other positions

    @property
    def order(self) -> int:
        """Order of the polynomial in position."""
        return int(len(self.coefficients_n) / (self.other_order + 1) ** len(self.others)) - 1

    @property
    def columns(self) -> tuple[str, ...]:
        """The columns of all positions that the load depends on."""
        return (POSITION, *self.others)

    def load_n(self, positions_m: Array) -> Array:
        """Compute the load [N], shape ``(n,)``; outside the coverage's range, the load at its nearer end.

        ``positions_m`` has shape ``(n, positions)``, or ``(n,)`` if the load depends on one position.
        """
        rows = np.reshape(positions_m, (len(positions_m), -1))
        shape = _polynomials(rows, self.range_m, self.coverage, self.order, self.other_order)
        return np.asarray(shape @ np.array(self.coefficients_n))

    def uncertainty_n(self, positions_m: Array) -> Array:
        """Compute the load's standard uncertainty (k = 1) [N], shape ``(n,)``: scatter and asymmetry."""
        place = _scaled(np.reshape(positions_m, (len(positions_m), -1))[:, 0], self.range_m)
        return np.hypot(np.interp(place, np.linspace(-1.0, 1.0, GRID), np.array(self.scatter_n)), self.asymmetry_n)

    def knows(self, positions_m: Array) -> Mask:
        """Mark positions with strokes in both directions, shape ``(n,)``; positions as for ``load_n``."""
        return self.coverage.holds(np.reshape(positions_m, (len(positions_m), -1)))

    def sentence(self, recording: Recording, cylinder: Cylinder) -> str:
        """State the result in words, with the ± of the worst position. It has absorbed the zeros of the sensors."""
        zero_n = zero_uncertainty_n(recording, cylinder)
        half_n = COVERAGE_FACTOR * math.hypot(max(self.scatter_n), self.asymmetry_n, zero_n or 0.0)
        (low_n, high_n), (from_m, to_m) = self.load_range_n, self.range_m
        low, high = f"{low_n:z.0f}", f"{high_n:z.0f}"
        load = f"{low} N" if low == high else f"{low} to {high} N"
        ranges_m = zip(self.others, self.coverage.ranges_m, strict=True)
        others = [f", {name} from {low:.3g} to {high:.3g} m" for name, (low, high) in ranges_m]
        return (
            f"the load is {load} ± {half_n:.0f} N between {from_m:.3g} and {to_m:.3g} m{''.join(others)}, "
            f"from strokes that passed these positions ({self.strokes_extend} out, {self.strokes_retract} in); "
            f"± {COVERAGE_FACTOR * self.asymmetry_n:.0f} N of that are assumed, not observed, for asymmetric friction, "
            f"which strokes do not tell from a load"
            f"{'; zeros, which are not stated, come on top' if zero_n is None else ''}"
        )

    @property
    def expanded_n(self) -> float:
        """Expanded uncertainty (k = 2) of load plus zeros, and so of friction [N], the median over positions."""
        return COVERAGE_FACTOR * math.hypot(float(np.median(self.scatter_n)), self.asymmetry_n)


@dataclass(frozen=True)
class _Candidate:
    """A fit of the load beside friction with some terms of speed."""

    design: Array
    fit: RobustFit
    half: Array  # Half the width of each coefficient's confidence interval
    error_n: float  # Sum of absolute residuals [N]
    determined: bool  # Whether strokes determine its friction


def identify_load(points: StrokePoints, plan: LoadPlan, others: tuple[str, ...] = ()) -> LoadIdentification:
    """Identify the load from the strokes of one session, whose force does not contain inertia.

    ``others`` names the columns of ``points.others_m``.

    Raises:
        RecordingError: Strokes of both directions do not overlap, or there are too few points.
    """
    coverage = covered(points, OTHER_REACH_M)
    range_m, points = coverage.range_m, points.where(coverage.holds(_positions(points)))
    if len(points) < _LEAST_POINTS_PER_COEFFICIENT * 3:
        raise RecordingError(
            f"load and friction cannot be separated: got {counted(len(points), 'point')} of 0.1 s where strokes of "
            f"both directions overlap; expected at least {_LEAST_POINTS_PER_COEFFICIENT * 3}; record slower or more "
            "strokes, or measure the load"
        )
    direction = np.sign(points.velocity_m_s)
    blocks = _blocks(points, direction)
    order, other_order = _orders(points, range_m, coverage, blocks)
    shape = _polynomials(_positions(points), range_m, coverage, order, other_order)
    of_load, linear = shape.shape[1], points.velocity_m_s[:, None]
    square, candidates = linear * np.abs(linear), list[_Candidate]()
    for terms in (linear[:, :0], linear, square, np.hstack([linear, square])):
        design = np.hstack([np.column_stack([shape, direction]), terms])
        fit = robust_fit(design, points.force_n)
        half = clustered_half_widths(design, fit, blocks, CONFIDENCE)
        determined = not terms.shape[1] or _determined(design, (fit.coefficients - half)[of_load:])
        candidates.append(_Candidate(design, fit, half, float(np.abs(fit.residuals).sum()), determined))
    least_n = min(each.error_n for each in candidates if each.determined)
    chosen = next(each for each in candidates if each.determined and each.error_n <= _AS_GOOD * least_n)
    alike = [each for each in candidates if each.determined and each.error_n <= _ALIKE * least_n]
    load, coulomb = chosen.fit.coefficients[:of_load], float(chosen.fit.coefficients[of_load])
    lows = [float((each.fit.coefficients - each.half)[of_load]) for each in alike]
    highs = [float((each.fit.coefficients + each.half)[of_load]) for each in alike]
    if coulomb <= 0.0 or min(lows) <= 0.0:
        found = f"load and friction cannot be separated: Coulomb friction would be {coulomb:.4g} N"
        raise RecordingError(
            f"{found}, but may be {min(lows):.4g} to {max(highs):.4g} N; record more strokes at slow, steady speed"
            if coulomb > 0.0
            else f"{found}, which drives the motion; check the sign of position and of the forces in the mapping"
        )
    grid, friction_n = np.linspace(*range_m, GRID), points.force_n - shape @ load
    along = _polynomials(coverage.middles_m if others else grid[:, None], range_m, coverage, order, other_order)
    covariance = clustered_covariance(chosen.design, chosen.fit, blocks)[:of_load, :of_load]
    scatter_n = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", along, covariance, along), 0.0))
    if not others:
        others_n = [each.fit.coefficients[:of_load] for each in candidates if _ALIKE * each.error_n < chosen.error_n]
        off_n = max((np.abs(along @ (each - load)) for each in others_n), key=np.max, default=0.0)
        scatter_n = np.hypot(scatter_n, RECTANGULAR * off_n)
        loads_n = (along @ load)[coverage.holds(grid[:, None])]
    else:
        sure = scatter_n < MOST_SCATTER * coulomb
        if not sure.any():
            raise RecordingError(
                f"the load is nowhere known to {MOST_SCATTER * coulomb:.0f} N, half of Coulomb friction, "
                f"from {counted(len(np.unique(points.stroke)), 'stroke')}; record more strokes with the "
                "other cylinders at rest"
            )
        loads_n = along[sure] @ load
        scatter_n = _worst_along(grid, coverage.middles_m[sure, 0], scatter_n[sure])
        coverage = replace(coverage, known=tuple(np.array(coverage.known)[sure].tolist()))
    return LoadIdentification(
        coefficients_n=tuple(load.tolist()),
        range_m=range_m,
        coverage=coverage,
        scatter_n=tuple(scatter_n.tolist()),
        asymmetry_n=math.hypot(plan.asymmetry, _FOLLOWS_PRESSURE * _pressure_differs(points))
        * max(coulomb, float(np.mean(np.abs(friction_n)))),
        coulomb_n=coulomb,
        coulomb_interval_n=(min(lows), max(highs)),
        load_range_n=(float(loads_n.min()), float(loads_n.max())),
        strokes_extend=len(np.unique(points.stroke[direction > 0.0])),
        strokes_retract=len(np.unique(points.stroke[direction < 0.0])),
        others=others,
        other_order=other_order,
    )


def _pressure_differs(points: StrokePoints) -> float:
    """Compute half the difference of pressure between the directions over its mean, 0 to 1."""
    extend_pa, retract_pa = (
        max(float(points.pressure_pa[points.velocity_m_s * sign > 0.0].mean()), 1.0) for sign in (1.0, -1.0)
    )
    return abs(extend_pa - retract_pa) / (extend_pa + retract_pa)


def _worst_along(grid: Array, position_m: Array, values: Array) -> Array:
    """Find the largest of the values nearest to each grid position; interpolate at positions without values."""
    nearest = np.rint((position_m - grid[0]) / (grid[1] - grid[0])).astype(np.int64)
    worst = np.full(len(grid), np.nan)
    np.fmax.at(worst, np.clip(nearest, 0, len(grid) - 1), values)
    known = np.isfinite(worst)
    return np.asarray(np.interp(grid, grid[known], worst[known]))


def _positions(points: StrokePoints) -> Array:
    return np.column_stack([points.position_m, points.others_m])


def _scaled(position_m: Array, range_m: tuple[float, float]) -> Array:
    first, last = range_m
    return np.clip(2.0 * (np.asarray(position_m) - first) / (last - first) - 1.0, -1.0, 1.0)


def _polynomials(
    positions_m: Array, range_m: tuple[float, float], coverage: Covered, order: int, other_order: int
) -> Array:
    """Compute all products of the Legendre polynomials in each position, shape ``(n, products)``."""
    products = legendre.legvander(_scaled(positions_m[:, 0], range_m), order)
    for other_m, first_m, count in zip(positions_m.T[1:], coverage.first_m, coverage.counts, strict=True):
        along = legendre.legvander(_scaled(other_m, (first_m, first_m + count * coverage.cell_m)), other_order)
        products = (products[:, :, None] * along[:, None, :]).reshape(len(products), -1)
    return np.asarray(products)


def _determined(design: Array, lowest: Array) -> bool:
    """Check whether strokes determine dry friction and each term of speed as positive.

    ``lowest`` holds the lower limits of their intervals. The last column of ``design`` is the last of these terms. If
    all strokes of a direction have one speed, position and direction explain nearly all of it. Viscous friction then
    cannot be told from Coulomb friction or, if the speeds of the directions differ, from a constant load.
    """
    others, last = design[:, :-1], design[:, -1]
    left = last - others @ np.linalg.lstsq(others, last, rcond=None)[0]
    return bool((lowest > 0.0).all()) and float(left @ left / (last @ last)) >= _OWN_SHARE


def _blocks(points: StrokePoints, direction: Array) -> NDArray[np.int64]:
    """Assign each point to a block.

    A stroke is a block. If a direction has few strokes, they are cut, so that each direction has at least about
    ``_BLOCKS_PER_DIRECTION`` blocks.
    """
    piece = np.zeros(len(points), dtype=np.int64)
    for each in (-1.0, 1.0):
        own = np.flatnonzero(direction == each)
        longest = max(1, math.ceil(len(own) / _BLOCKS_PER_DIRECTION))
        stroke = points.stroke[own]
        piece[own] = (np.arange(len(own)) - np.searchsorted(stroke, stroke, side="left")) // longest
    keys = np.stack([points.stroke, piece])
    return np.unique(keys, axis=1, return_inverse=True)[1].astype(np.int64).ravel()


def _vary_by_themselves(points: StrokePoints, range_m: tuple[float, float]) -> bool:
    """Check whether each of the other positions varies independently of the piston's position."""
    along = legendre.legvander(_scaled(points.position_m, range_m), _FOLDS)
    left_m = points.others_m - along @ np.linalg.lstsq(along, points.others_m, rcond=None)[0]
    return bool((np.sqrt(np.mean(left_m**2, axis=0)) >= LEAST_SPREAD * OTHER_REACH_M).all())


def _orders(
    points: StrokePoints, range_m: tuple[float, float], coverage: Covered, blocks: NDArray[np.int64]
) -> tuple[int, int]:
    """Choose the orders of the polynomial in position and in the other positions.

    Of the orders whose error on left-out blocks is within 1 % of the least, take those with the fewest coefficients.
    """
    direction = np.sign(points.velocity_m_s)
    others = points.others_m.shape[1]
    greatest_other = GREATEST_OTHER_ORDER if others and _vary_by_themselves(points, range_m) else 0
    greatest = len(points) // _LEAST_POINTS_PER_COEFFICIENT - 2
    sizes = {
        (order, other_order): (order + 1) * (other_order + 1) ** others
        for order in range(GREATEST_ORDER + 1)
        for other_order in range(greatest_other + 1)
    }
    fold = blocks % _FOLDS
    errors: dict[tuple[int, int], float] = {}
    for orders in sorted(sizes, key=lambda each: (sizes[each], each)):
        if sizes[orders] > max(greatest, 0) + 1:
            break
        shape = _polynomials(_positions(points), range_m, coverage, *orders)
        design = np.column_stack([shape, direction, points.velocity_m_s])
        total = 0.0
        for each in range(_FOLDS):
            out = fold == each
            if out.any() and not out.all():
                fit = robust_fit(design[~out], points.force_n[~out])
                total += float(np.abs(points.force_n[out] - design[out] @ fit.coefficients).sum())
        errors[orders] = total
    return next(orders for orders, error in errors.items() if error <= _AS_GOOD * min(errors.values()))
