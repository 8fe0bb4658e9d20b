"""The static friction curve: Coulomb, Stribeck and viscous friction against velocity, and its robust fit."""

import math
from dataclasses import dataclass

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.friction_models.parameters import RETRACT_RATIO, STRIBECK, STRIBECK_EXPONENT, refuse_impossible
from cylinder_friction.wording import counted

HUBER_NOISE_MULTIPLE = 1.345
"""Residual at which Huber's loss turns linear, in standard deviations of the noise; 95 % efficient on normal noise."""


CURVE_PARAMETERS = 6
"""Least number of points for a fit: one per parameter."""


@dataclass(frozen=True)
class StribeckCurve:
    """Friction in steady sliding, positive when it opposes positive velocity.

    ``F(v) = sgn(v) * side(v) * [Fc + (Fs - Fc) * exp(-|v / vs|**a)] + s2 * v`` with ``side`` 1 while extending and
    ``retract_ratio`` while retracting. At ``v = 0`` the curve gives 0: sticking friction is not a function of velocity.

    Raises:
        ValueError: A number is not finite or not positive (viscous may be zero), or static is below Coulomb.

    Source: Armstrong-Helouvry, Dupont and Canudas de Wit 1994, section 2.1.

    Example:
        >>> import numpy as np
        >>> from cylinder_friction.friction_models.stribeck import StribeckCurve
        >>> curve = StribeckCurve(300.0, 420.0, 0.01, 1.0, viscous_n_s_m=800.0, retract_ratio=1.1)
        >>> curve.friction(np.array([-0.1, 0.0, 0.1])).round(1).tolist()
        [-410.0, 0.0, 380.0]
    """

    coulomb_n: float  # Coulomb friction Fc while extending [N]
    # Static friction Fs while extending, at least ``coulomb_n``: the curve's limit at low speed [N]
    static_n: float
    stribeck_velocity_m_s: float  # Speed vs over which friction falls from static to Coulomb [m/s]
    stribeck_exponent: float  # Shape a of that fall
    viscous_n_s_m: float  # Viscous coefficient s2 [N s/m]
    retract_ratio: float = 1.0  # Dry friction while retracting over dry friction while extending

    def __post_init__(self) -> None:
        refuse_impossible(self, (*STRIBECK, RETRACT_RATIO))

    def dry_friction(self, velocity_m_s: Array) -> Array:
        """Compute friction without sign and viscous part, ``g(v) > 0`` [N], of the velocity's shape."""
        velocity = np.asarray(velocity_m_s, dtype=np.float64)
        falling = np.exp(-((np.abs(velocity) / self.stribeck_velocity_m_s) ** self.stribeck_exponent))
        side = np.where(velocity < 0.0, self.retract_ratio, 1.0)
        return np.asarray(side * (self.coulomb_n + (self.static_n - self.coulomb_n) * falling))

    def friction(self, velocity_m_s: Array) -> Array:
        """Compute friction in steady sliding [N], of the velocity's shape."""
        velocity = np.asarray(velocity_m_s, dtype=np.float64)
        return np.asarray(np.sign(velocity) * self.dry_friction(velocity) + self.viscous_n_s_m * velocity)

    def speed_of_least_friction(self) -> float:
        """Find the extension speed of least friction, between the fall and the viscous rise [m/s], to within 3 %."""
        speeds = self.stribeck_velocity_m_s * np.geomspace(0.1, 100.0, 301)
        return float(speeds[np.argmin(self.friction(speeds))])


def fit_stribeck(velocity_m_s: Array, friction_n: Array, weight: Array | None = None) -> StribeckCurve:
    """Fit a curve to points of steady sliding in both directions, with Huber's loss so that outliers count less.

    Velocity and friction are signed; no velocity is zero. All arrays have shape ``(n,)``. Without ``weight``, all
    points count equally.

    Raises:
        ValueError: There are fewer points than parameters.

    Example:
        >>> import numpy as np
        >>> from cylinder_friction.friction_models.stribeck import StribeckCurve, fit_stribeck
        >>> curve = StribeckCurve(300.0, 420.0, 0.01, 1.0, viscous_n_s_m=800.0)
        >>> speed_m_s = np.geomspace(0.002, 0.2, 20)
        >>> velocity_m_s = np.concatenate([-speed_m_s, speed_m_s])
        >>> round(fit_stribeck(velocity_m_s, curve.friction(velocity_m_s)).coulomb_n)
        300
    """
    from scipy.optimize import least_squares  # slow to import, and most uses of a curve fit none

    velocity, friction = np.asarray(velocity_m_s, dtype=np.float64), np.asarray(friction_n, dtype=np.float64)
    if len(velocity) < CURVE_PARAMETERS:
        raise ValueError(
            f"a Stribeck curve has {CURVE_PARAMETERS} parameters, but got {counted(len(velocity), 'point')} of steady "
            "sliding; record more strokes at constant velocity, in both directions"
        )
    root_weight = np.sqrt(np.ones_like(velocity) if weight is None else weight / np.mean(weight))
    speed, level = np.abs(velocity), float(np.median(np.abs(friction)))
    span = float(np.max(speed))
    start = np.array([math.log(level), 0.3, math.log(max(float(np.min(speed)), 0.1 * span)), 1.0, 0.1, 0.0])
    exponent, ratio = STRIBECK_EXPONENT, RETRACT_RATIO
    lower = np.array([math.log(level / 20.0), 0.0, math.log(span / 1000.0), exponent.lower, 0.0, math.log(ratio.lower)])
    upper = np.array([math.log(level * 5.0), 3.0, math.log(span), exponent.upper, 5.0, math.log(ratio.upper)])

    def curve_at(numbers: Array) -> StribeckCurve:
        coulomb = math.exp(numbers[0])
        return StribeckCurve(
            coulomb_n=coulomb,
            static_n=coulomb * (1.0 + float(numbers[1])),
            stribeck_velocity_m_s=math.exp(numbers[2]),
            stribeck_exponent=float(numbers[3]),
            viscous_n_s_m=float(numbers[4]) * level / span,
            retract_ratio=math.exp(numbers[5]),
        )

    def residuals(numbers: Array) -> Array:
        return np.asarray(root_weight * (curve_at(numbers).friction(velocity) - friction))

    scale = 0.05 * level
    for _ in range(3):  # the noise, and with it Huber's threshold, is known only after a fit
        result = least_squares(residuals, start, bounds=(lower, upper), loss="huber", f_scale=scale)
        spread = 1.4826 * float(np.median(np.abs(residuals(result.x))))
        scale = max(HUBER_NOISE_MULTIPLE * spread, 1e-3 * level)
        start = np.clip(result.x, lower + 1e-9, upper - 1e-9)
    return curve_at(result.x)
