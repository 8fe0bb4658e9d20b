"""Fit the reference of an indicator: its expected value, given oil, pressure, speed and load.

The baseline's sessions fit a regression y = level + Σ coefficient·covariate + error with an AR(1) error. A prior states
how much of friction a kelvin or a bar may reasonably change. A covariate that did not vary in the baseline keeps its
prior, so that a session far from the baseline has a wide uncertainty.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cylinder_friction.recordings.columns import OIL_TEMPERATURE
from cylinder_friction_monitoring.arrays import Array
from cylinder_friction_monitoring.trends.session_row import SessionRow

VISCOSITY_1_K = 0.033  # Relative fall of the oil's viscosity per kelvin, near 40 °C
STRONGER = {"viscous_n_s_m": 4.0, "leak_m3_s_pa": 4.0}  # Factor on the priors of indicators that depend on viscosity
THIN_OIL = ("leak_m3_s_pa",)  # Indicators that follow the inverse of viscosity, like the flow through a gap
BENT_1_K = 0.01
"""Bend of the viscosity effect: after 1 / this in kelvins it may differ from a straight line by its prior."""
PRIORS = {OIL_TEMPERATURE: 0.005, "pressure_bar": 0.02, "speed_m_s": 10.0, "load_n": 3e-4}
"""Prior standard deviation of each covariate's relative effect on friction, per unit of the covariate."""
LEAST_KNOWN = 0.9  # Least share of the baseline's sessions with a covariate that is used
LARGEST_AUTOCORRELATION = 0.9
KNOTS = 5  # Number of knots of the curve that shows whether a baseline is steady
STEADY = 5.0  # Largest movement of a steady baseline [standard deviations of a session from the curve]
STEADY_SHORT = 45.0  # The same times the root of the number of sessions, for a short baseline
_PASSES = 4


@dataclass(frozen=True)
class Reference:
    """The expected value of an indicator; level, scatter and noise are in the indicator's unit."""

    level: float  # Expected value at the baseline's mean covariates
    scatter: float  # Standard deviation of sessions from the expected value
    autocorrelation: float  # Autocorrelation of neighbouring sessions, corrected for the bias of a short baseline
    noise: float  # Mean uncertainty of a single session, from its strokes
    centre: Mapping[str, float]  # Mean of each covariate in use
    scale: Array  # Scale of each design column, so that its coefficient has a prior of 1
    coefficients: Array  # Coefficients, level first, in the indicator's unit
    covariance: Array  # Covariance of the coefficients
    viscosity_power: float = 1.0  # 1, or -1 for an indicator that rises as the oil thins
    moved: float = 0.0  # How far the expected value moved within the baseline, signed; 0 if it was steady

    @property
    def innovation(self) -> float:
        """Standard deviation of a session given the one before, in the indicator's unit."""
        return float(self.scatter * np.sqrt(1.0 - self.autocorrelation**2))

    def design(self, covariates: Mapping[str, Array]) -> Array:
        """Compute the regressors of sessions, shape ``(sessions, coefficients)``; NaN if one is not known."""
        count = len(next(iter(covariates.values())))
        columns = [self._response(name, covariates[name]) for name in self.centre]
        bent = [BENT_1_K * columns[0] ** 2] if OIL_TEMPERATURE in self.centre else []
        return np.column_stack([np.ones(count), *columns, *bent]) * self.scale

    def _response(self, name: str, values: Array) -> Array:
        """Compute the distance of a covariate from its mean; for oil by its viscosity, as kelvins of cooling."""
        if name == OIL_TEMPERATURE:
            power = self.viscosity_power * VISCOSITY_1_K
            return np.asarray(np.expm1(-power * (values - self.centre[name])) / power)
        return np.asarray(values - self.centre[name])

    def uncertainty(self, design: Array) -> Array:
        """Compute the standard uncertainty of the expected value, shape ``(sessions,)``, in the indicator's unit."""
        return np.sqrt(np.einsum("si,ij,sj->s", design, self.covariance, design))


def covariates_of(rows: Sequence[SessionRow]) -> dict[str, Array]:
    """Collect the covariates by name, shape ``(sessions,)``; NaN if not known.

    Pressures enter by their mean, because their difference is friction itself.
    """

    def column(name: str) -> Array:
        values = [row.covariates.get(name) for row in rows]
        return np.array([np.nan if value is None else value for value in values], dtype=np.float64)

    return {
        OIL_TEMPERATURE: column(OIL_TEMPERATURE),
        "pressure_bar": 0.5 * (column("pressure_1_bar") + column("pressure_2_bar")),
        "speed_m_s": column("speed_m_s"),
        "load_n": column("load_n"),
    }


def fitted(
    indicator: str, values: Array, uncertainties: Array, covariates: Mapping[str, Array], level: float
) -> Reference:
    """Fit the reference to the baseline's sessions, which all have a value, shape ``(sessions,)``.

    The priors are shares of ``level``, in the indicator's unit.
    """
    used = [name for name in PRIORS if np.isfinite(covariates[name]).mean() >= LEAST_KNOWN]
    centre = {name: float(np.nanmean(covariates[name])) for name in used}
    unit = max(abs(level), float(values.std())) or 1.0
    size = unit * STRONGER.get(indicator, 1.0)
    bent = [size * PRIORS[OIL_TEMPERATURE]] if OIL_TEMPERATURE in used else []
    scale = np.array([1.0, *(size * PRIORS[name] for name in used), *bent])
    power = -1.0 if indicator in THIN_OIL else 1.0
    unfitted = Reference(level, 0.0, 0.0, 0.0, centre, scale, np.zeros(0), np.zeros((0, 0)), power)
    units = np.array([1.0] + [unit] * (len(scale) - 1))
    design, values = np.nan_to_num(unfitted.design(covariates)) / units, values / unit
    prior = np.diag([0.0] + [1.0] * (len(scale) - 1))
    autocorrelation, variance = 0.0, max(float(values.var()), 1e-30)
    for _ in range(_PASSES):
        x, y = _whitened(design, autocorrelation), _whitened(values[:, None], autocorrelation)[:, 0]
        covariance = np.linalg.inv(x.T @ x / variance + prior)
        coefficients = covariance @ x.T @ y / variance
        used_up = float(np.trace(covariance @ x.T @ x) / variance)
        variance = max(float(np.sum((y - x @ coefficients) ** 2) / (len(y) - used_up)), 1e-30)
        autocorrelation = _autocorrelation(values - design @ coefficients, used_up)
    return Reference(
        level=unit * float(coefficients[0]),
        scatter=unit * float(np.sqrt(variance / (1.0 - autocorrelation**2))),
        autocorrelation=autocorrelation,
        noise=float(np.sqrt(np.mean(uncertainties**2))),
        centre=centre,
        scale=scale,
        coefficients=coefficients * unit / units,
        covariance=np.asarray(covariance * np.outer(unit / units, unit / units)),
        viscosity_power=power,
        moved=unit * _moved(values - design @ coefficients),
    )


def _moved(left: Array) -> float:
    """Fit a curve to what the covariates leave of a baseline. Return how far it moves; 0 if that is scatter.

    The curve is a polygon with ``KNOTS`` knots. It rises if its highest point comes after its lowest one.
    """
    count = len(left)
    hats = np.maximum(1.0 - np.abs(np.linspace(0.0, KNOTS - 1.0, count)[:, None] - np.arange(KNOTS)), 0.0)
    curve = hats @ np.linalg.lstsq(hats, left)[0]
    least = max(STEADY, STEADY_SHORT / np.sqrt(count)) * float(np.std(left - curve))
    size = float(np.ptp(curve))
    return 0.0 if size < least else size if np.argmax(curve) > np.argmin(curve) else -size


def _whitened(values: Array, autocorrelation: float) -> Array:
    """Subtract the part that the session before explains, and give the first session equal weight; shape as given."""
    whitened = values.copy()
    whitened[1:] -= autocorrelation * values[:-1]
    whitened[0] *= np.sqrt(1.0 - autocorrelation**2)
    return whitened


def _autocorrelation(residuals: Array, used_up: float) -> float:
    """Compute the correlation of neighbours, corrected for the fitted regression, which lowers it."""
    count = len(residuals)
    total = float(residuals @ residuals)
    found = float(residuals[1:] @ residuals[:-1]) / total if total > 0.0 else 0.0
    found += (used_up + 3.0 * max(found, 0.0)) / count + np.sqrt((1.0 - min(found**2, 1.0)) / count)
    return float(np.clip(found, 0.0, LARGEST_AUTOCORRELATION))
