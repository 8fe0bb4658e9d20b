"""Find what else changed together with an indicator: oil, pressure, speed, load, travel, or the sensors' zeros."""

from collections.abc import Mapping, Sequence

import numpy as np

from cylinder_friction.recordings.columns import OIL_TEMPERATURE
from cylinder_friction_monitoring.arrays import Array
from cylinder_friction_monitoring.trends.session_row import COVARIATES, Covariate, SessionRow

AROUND = 20  # Number of sessions before and after the change that are compared
TIMES = 2.0  # Least difference of a covariate's means that is a change, in standard deviations of a session
MEAN_PRESSURE = Covariate("bar", "mean pressure", 1.0)


def changed_beside(rows: Sequence[SessionRow], begins: int, zero: tuple[float, float] | None) -> tuple[str, ...]:
    """Describe what changed around session ``begins``.

    ``zero`` is the change of an alarmed half sum at that time, and its uncertainty [N].
    """
    found = []
    for name, (unit, title, least) in COVARIATES.items():
        before, after = (
            _known(rows[part], name)
            for part in (slice(max(begins - AROUND, 0), begins), slice(begins, begins + AROUND))
        )
        if min(len(before), len(after)) < 3:
            continue
        difference = float(after.mean() - before.mean())
        scatter = float(np.sqrt(0.5 * (before.var(ddof=1) + after.var(ddof=1))))
        if abs(difference) > max(TIMES * scatter, least):
            found.append(f"{title} {difference:+.3g} {unit}")
    if zero is not None:
        found.append(f"half sum of the strokes {zero[0]:+.0f} ± {zero[1]:.0f} N (a sensor's zero, or the load)")
    return tuple(found)


def farthest(names: Mapping[str, float], design: Array, covariance: Array, row: SessionRow) -> str:
    """State in words which covariate makes a session differ most from the baseline.

    The first regressor in ``design`` is the level. The last is the bend of the oil's effect, if oil is in ``names``.
    """
    regressors = [*names, *(name for name in names if name == OIL_TEMPERATURE)]
    missing = [name for name, value in zip(regressors, design[1:], strict=True) if not np.isfinite(value)]
    if missing:
        return f"{COVARIATES.get(missing[0], MEAN_PRESSURE).title} is not known"
    name = regressors[int(np.argmax(design[1:] ** 2 * np.diag(covariance)[1:]))]
    values = (
        (row.covariates[each] for each in ("pressure_1_bar", "pressure_2_bar"))
        if name == "pressure_bar"
        else (row.covariates[name],)
    )
    now = float(np.mean([value for value in values if value is not None]))
    unit, title, _ = COVARIATES.get(name, MEAN_PRESSURE)
    return f"{title} is {_digits(now)} {unit}, in the baseline {_digits(names[name])} {unit} on average"


def _digits(value: float) -> str:
    """Write a number with four digits and without a power of ten."""
    return f"{float(f'{value:.4g}'):g}"


def _known(rows: Sequence[SessionRow], name: str) -> Array:
    values = (row.covariates.get(name) for row in rows)
    return np.array([value for value in values if value is not None], dtype=np.float64)
