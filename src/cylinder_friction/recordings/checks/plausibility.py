"""Check that friction opposes motion. If it drives the motion, signals are swapped, inverted or have a wrong sign.

Over rows of clear and even motion, the drive force F = P1·A1 - P2·A2 less the load is regressed on the direction of
motion and a smooth function of position:

    F = b·sign(v) + a0 + a1·x + a2·x² + a3·x³

b is half the difference between extension and retraction at equal positions. It is friction, which must be positive,
free of constant sensor offsets and of a load that depends on position alone. The residual shows whether the pressures
are swapped: P1 and P2 rise and fall together, and cancel only if each is weighted with its own area.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.recordings.checks.limits import CheckLimits, Finding, Outcome
from cylinder_friction.recordings.columns import DRIVE_FORCE, LOAD_FORCE, POSITION, PRESSURES

HALF_WINDOW_S = 0.05  # Half the time over which velocity is computed as a difference [s]
ROWS = 5_000  # Most rows used, evenly spread; more do not make the result more certain
FEWEST_ROWS = 20  # Fewest rows of clear motion in each direction
SURE = 3.0  # A mean differs from zero beyond this many standard errors. Strokes count as independent, rows do not
BETTER = 2.0  # Least ratio of residuals at which the smaller one's hypothesis is preferred; 3 without further evidence
LEAST_OVERLAP = 0.2
"""Least share of the variance of direction that position does not explain. Below it, the two are inseparable."""
NEGLIGIBLE = 1e-7  # Least size of a combination of terms that rows determine, as a share of the largest one
GREATEST_N_MM, HIGH_N_MM, LOW_N_MM, LEAST_N_MM = 100.0, 10.0, 0.2, 0.1
"""Friction per length of seal around piston and rod [N/mm]: above any seal's, rarely exceeded, low-friction seals, and
below any seal's."""
COMPUTED = 0.05
"""Largest share of the force turning with the direction that remains if the load was computed from the pressures."""


@dataclass(frozen=True)
class Balance:
    """The force balance of one interpretation of the signals."""

    friction_n: float  # Half the difference between extension and retraction, b [N]
    residual_n: float  # Root mean square of the force that neither b nor position explains [N]
    extending_n: float  # Mean force against the motion while extending [N]
    retracting_n: float  # Mean force against the motion while retracting [N]
    sure_n: float  # Smallest size of ``friction_n`` that differs from zero [N]

    @property
    def dissipates(self) -> bool:
        return self.friction_n > self.sure_n

    @property
    def drives(self) -> bool:
        return self.friction_n < -self.sure_n

    @property
    def weaker_n(self) -> float:
        """The smaller of the two mean forces against the motion [N]."""
        return min(self.extending_n, self.retracting_n)

    def in_words(self) -> str:
        return (
            f"the force against the motion is {self.extending_n:.3g} N extending and {self.retracting_n:.3g} N "
            f"retracting ({self.friction_n:.3g} N at equal position)"
        )


def check_friction(columns: Mapping[str, Array], sample_time_s: float, limits: CheckLimits) -> list[Finding]:
    """Check ``direction`` (swapped or inverted signals) and ``friction_size`` (a wrong unit).

    A recording is refused only if friction clearly drives the motion, or if forces balance far better with signals
    swapped or inverted. A finding that an unstated load or offset could explain is only noted.
    """
    rows, direction = _clear_motion(columns[POSITION], sample_time_s, limits.cylinder.stroke_m)
    shape = _position_terms(columns[POSITION][rows])
    fewest = int(min(np.count_nonzero(direction > 0.0), np.count_nonzero(direction < 0.0)))
    problem = ""
    if limits.load == "measured" and LOAD_FORCE not in columns:
        problem = f"{LOAD_FORCE} is not recorded, though the load is to be measured"
    elif fewest < FEWEST_ROWS:
        problem = f"the piston moves clearly in both directions in {fewest} rows only, expected {FEWEST_ROWS} each"
    elif np.var(_beyond(shape, direction)) < LEAST_OVERLAP * np.var(direction):
        problem = "extension and retraction hardly pass the same positions"
    if problem:
        return [Finding("direction", "noted", f"whether friction opposes the motion cannot be decided: {problem}")]
    load, load_n = limits.load, columns[LOAD_FORCE][rows] if limits.load == "measured" else np.zeros(len(rows))
    if DRIVE_FORCE in columns:
        drive_n = columns[DRIVE_FORCE][rows]
        as_is, turned = _balances(direction, shape, drive_n - load_n, drive_n + load_n)
        remedy = f"change the sign of position_m or of {DRIVE_FORCE} in the mapping"
        return _inverted_load(as_is, turned, limits) or _opposing(as_is, limits, remedy)
    a1, a2 = limits.cylinder.piston_area_m2, limits.cylinder.annulus_area_m2
    p1, p2 = (columns[name][rows] for name in PRESSURES)
    drive_n, exchanged_n = p1 * a1 - p2 * a2, p2 * a1 - p1 * a2
    forces = drive_n - load_n, exchanged_n - load_n, drive_n + load_n, (p1 - p2) * a2
    as_is, swapped, turned, alike = _balances(direction, shape, *forces)
    findings = _computed_load(direction, shape, drive_n, load_n, limits) or _inverted_load(as_is, turned, limits)
    findings = findings or _direction(as_is, swapped, limits)
    explained = as_is.weaker_n <= 0.0 < 0.5 * alike.friction_n < alike.weaker_n  # by equal areas
    if explained and load == "none" and not limits.cylinder.rod_diameter_1_m:
        rods = "if the cylinder has a rod on both sides, state the second one too (rod_diameter_1_m)"
        rods = f"with equal areas, {alike.in_words()}: {rods}"
        findings = [replace(each, text=f"{rods}; if not, {each.text}") for each in findings]
    refused = any(each.outcome == "refused" for each in findings)
    return findings if refused else findings + _size(as_is, limits.cylinder)


def _clear_motion(position_m: Array, sample_time_s: float, stroke_m: float) -> tuple[NDArray[np.int64], Array]:
    """Choose rows of fast, even motion away from the ends, and their direction: 1 extending, -1 retracting."""
    half = max(1, round(HALF_WINDOW_S / sample_time_s))
    first, last, step = 2 * half, len(position_m) - 2 * half, max(1, len(position_m) // ROWS)
    rows = np.arange(first, last, step)
    if len(rows) == 0:
        return rows, np.empty(0)

    def later(by: int) -> Array:
        return position_m[first + by : last + by : step]

    here, step_s = later(0), half * sample_time_s
    moved = later(half) - later(-half)
    bend = later(2 * half) - 2.0 * here + later(-2 * half)
    jitter = later(1) - 2.0 * here + later(-1)
    noise = float(np.median(np.abs(jitter))) / 1.65  # median of |second difference| of white noise is 1.65 sigma
    top = float(np.quantile(np.abs(moved), 0.95))
    clear = (
        (np.abs(moved) > max(0.2 * top, 6.0 * noise))
        & (here > 0.05 * stroke_m)
        & (here < 0.95 * stroke_m)
        & (np.abs(bend) / (2.0 * step_s) < 4.0 * top)  # acceleration = bend / (2 step)², speed = moved / (2 step)
    )
    return rows[clear], np.sign(moved[clear])


def _position_terms(position_m: Array) -> Array:
    """Combine the powers 0 to 3 of positions to orthonormal terms, shape ``(n, 4)``, fewer if rows determine fewer."""
    if not len(position_m):
        return np.empty((0, 4))
    scaled = (position_m - position_m.mean()) / max(float(np.std(position_m)), 1e-12)
    terms, sizes, _ = np.linalg.svd(np.vander(scaled, 4), full_matrices=False)
    return np.asarray(terms[:, sizes > NEGLIGIBLE * sizes[0]])


def _beyond(shape: Array, values: Array) -> Array:
    """Compute the part of values, shape ``(n, ...)``, that the position does not explain."""
    return np.asarray(values - shape @ (shape.T @ values))


def _balances(direction: Array, shape: Array, *forces: Array) -> list[Balance]:
    own, left_n = _beyond(shape, direction), _beyond(shape, np.column_stack(forces))
    factors = own @ left_n / (own @ own)
    residuals_n = np.sqrt(np.mean((left_n - own[:, None] * factors) ** 2, axis=0)).tolist()
    out, strokes = direction > 0.0, int(np.count_nonzero(np.diff(direction))) + 1
    means = [(float(force[out].mean()), -float(force[~out].mean())) for force in forces]
    sure = SURE / math.sqrt(strokes)
    return [
        Balance(friction_n, residual_n, *mean_n, sure * residual_n)
        for friction_n, residual_n, mean_n in zip(factors.tolist(), residuals_n, means, strict=True)
    ]


def _computed_load(direction: Array, shape: Array, drive_n: Array, load_n: Array, limits: CheckLimits) -> list[Finding]:
    """Refuse a load that is a multiple of the pressures' force, as loggers compute it: it shares their noise."""
    if limits.load != "measured" or limits.stated_load:
        return []
    own, drive, load = (_beyond(shape, each) for each in (direction, drive_n, load_n))
    (share, left_n), *_ = np.linalg.lstsq(np.column_stack([drive, own]), load)
    friction_n = float(own @ drive / (own @ own))
    least_n = min(LEAST_N_MM * _seal_mm(limits.cylinder), COMPUTED * abs(share * friction_n))
    if abs(left_n) >= least_n or abs(share) < 0.5:
        return []
    text = (
        f"the mapped {LOAD_FORCE} is {share:.3g} times the force of the pressures, with its {friction_n:.3g} N of "
        "friction: it is a force computed from the pressures, not that of a load cell; leave it out of the mapping, "
        "or, if no mapping was given, state --load none"
    )
    return [Finding("direction", "refused", text)]


def _inverted_load(as_is: Balance, turned: Balance, limits: CheckLimits) -> list[Finding]:
    """Refuse the recording if its forces balance only with the sign of the load reversed."""
    opposes = as_is.weaker_n < -as_is.sure_n and turned.weaker_n > 0.5 * turned.friction_n
    better = opposes or as_is.residual_n > (BETTER + 1.0) * turned.residual_n
    if limits.load != "measured" or not (turned.dissipates and better):
        return []
    stated = limits.stated_load and f"the stated load of {limits.stated_load.force_n:g} N (--load, or the mapping's)"
    text = (
        f"{stated or 'the mapped load_force_n'} is inverted: as it stands, {as_is.in_words()}; the other way round, "
        f"{turned.in_words()}; change its sign (it is positive where the load resists extension)"
    )
    return [Finding("direction", "refused", text)]


def _direction(as_is: Balance, swapped: Balance, limits: CheckLimits) -> list[Finding]:
    """Compare four interpretations: signals as they are, pressures swapped, position inverted, or both."""
    clearly_wrong = as_is.drives or (limits.load != "position" and as_is.weaker_n < -as_is.sure_n)
    ratio = as_is.residual_n / max(swapped.residual_n, 1e-12)
    if ratio > (BETTER if clearly_wrong else BETTER + 1.0) and (swapped.dissipates or swapped.drives):
        also = "" if swapped.dissipates else " and position_m is inverted"
        text = (
            f"the pressures are swapped{also}: as they stand, {as_is.in_words()} and {as_is.residual_n:.3g} N of the "
            f"force are explained by nothing; the other way round, friction is {abs(swapped.friction_n):.3g} N and "
            f"{swapped.residual_n:.3g} N are left; exchange the channels of pressure_1_pa (piston side) and "
            "pressure_2_pa" + (", and change the sign of position_m" if also else "")
        )
        return [Finding("direction", "refused", text)]
    remedy = (
        "position_m is inverted, or both pressures are: correct what is inverted in the mapping by sign: -1 and, as "
        "offset, what its sensor reads with the rod in or without pressure (position_m must grow while the rod extends)"
        if 1.0 / ratio > BETTER
        else "position_m is inverted, both pressures are inverted, or they are swapped; check all three"
    )
    return _opposing(as_is, limits, remedy)


def _opposing(as_is: Balance, limits: CheckLimits, remedy: str) -> list[Finding]:
    """Refuse friction that drives the motion, and advise the ``remedy``; note what may be an unstated load."""
    if as_is.drives:
        text = f"friction would drive the piston: {as_is.in_words()}; expected it to oppose the motion; {remedy}"
        return [Finding("direction", "refused", text)]
    if not as_is.dissipates:
        unexplained = f"({as_is.residual_n:.3g} N are unexplained)"
        text = f"friction of {as_is.friction_n:.3g} N cannot be distinguished from zero {unexplained}"
        return [Finding("direction", "noted", text)]
    if limits.load != "position" and as_is.weaker_n < 0.0:
        measured = limits.load == "measured"
        check = "check the stated load" if limits.stated_load else "check unit and zero of load_force_n"
        load_n = 0.5 * (as_is.extending_n - as_is.retracting_n)
        text = (
            f"{as_is.in_words()}: one of them drives the motion, so there is {'another' if measured else 'a'} load of "
            f"about {load_n:.3g} N, or a pressure sensor's zero is off; "
            f"{check if measured else 'state the load'}, or zero the sensors"
        )
        return [Finding("direction", "noted", text)]
    return []


def _seal_mm(cylinder: Cylinder) -> float:
    """Compute the length of all seals around piston and rods [mm]."""
    return math.pi * 1e3 * (cylinder.bore_diameter_m + cylinder.rod_diameter_m + cylinder.rod_diameter_1_m)


def _size(as_is: Balance, cylinder: Cylinder) -> list[Finding]:
    """Relate friction to the length of the seals, which shows pressures in a wrong unit."""
    gradient = as_is.friction_n / _seal_mm(cylinder)
    text = f"friction is {gradient:.3g} N per millimetre of seal ({as_is.friction_n:.3g} N)"
    outcome: Outcome = "noted"
    if as_is.friction_n <= 0.0:
        text += (
            ", expected more than 0, for it opposes the motion; check which pressure is which, the sign of position_m, "
            "and that each channel has its own time"
        )
    elif gradient > GREATEST_N_MM:
        outcome = "refused"
        text += (
            f", expected less than {GREATEST_N_MM:.0f}; check the unit of the pressures (kPa read as bar?), bore and "
            "rod of the cylinder, and whether it works against a load that is not stated"
        )
    elif gradient > HIGH_N_MM or (as_is.dissipates and gradient < LOW_N_MM):
        unit = "bar read as MPa?" if gradient > HIGH_N_MM else "MPa read as bar?"
        usual = f"usual are {LOW_N_MM:g} to {HIGH_N_MM:g}"
        text += f", {usual}; check the unit of the pressures ({unit}), bore and rod of the cylinder"
    else:
        return []
    return [Finding("friction_size", outcome, text)]
