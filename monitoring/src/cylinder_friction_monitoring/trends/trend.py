"""Test one indicator of a cylinder against its baseline, and describe the change behind an alarm."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import timedelta

import numpy as np

from cylinder_friction_monitoring.arrays import Array
from cylinder_friction_monitoring.trends.assessment import Baseline, Change, IndicatorTrend
from cylinder_friction_monitoring.trends.cusum import Cusum, cusum, threshold
from cylinder_friction_monitoring.trends.dating import Dated, dated
from cylinder_friction_monitoring.trends.moments import moment
from cylinder_friction_monitoring.trends.plan import MonitorPlan
from cylinder_friction_monitoring.trends.reference import Reference, covariates_of, fitted
from cylinder_friction_monitoring.trends.session_row import INDICATORS, SessionRow

TESTED = tuple(INDICATORS)  # Indicators that share the stated rate of false alarms
DAYS_A_YEAR = 365.25
FORESEEN_D = 36525.0  # Longest time until a limit is reached that is stated [days]
FEW = 5  # Number of sessions whose mean shows whether a limit is passed
BEYOND = 5
"""Number of latest sessions without a value, or too far from the baseline, that hide the present."""


@dataclass(frozen=True)
class Tested:
    """The test of an indicator over the sessions that have a value."""

    indicator: str
    rows: tuple[SessionRow, ...]
    values: Array  # Values in the indicator's unit, shape ``(sessions,)`` like the following arrays
    residuals: Array  # Values less expected values
    expected: Array  # Standard uncertainty of the expected values
    reference: Reference
    test: Cusum
    baseline: Baseline

    @property
    def compensated(self) -> Array:
        """Values at the baseline's covariates; NaN if a session's covariates are not known."""
        return self.reference.level + self.residuals

    @property
    def alarm(self) -> int | None:
        """The first session at which the test exceeds its threshold, or None."""
        over = np.flatnonzero(np.fmax(self.test.upward, self.test.downward) > self.baseline.threshold)
        return int(over[0]) if len(over) else None

    @property
    def watched(self) -> bool:
        """Whether the test stands above half of its threshold."""
        last = max(self.test.upward[-1], self.test.downward[-1])
        return len(self.rows) > self.baseline.sessions and bool(last > 0.5 * self.baseline.threshold)

    @property
    def beyond(self) -> int:
        """Number of latest sessions in a row that were too far from the baseline."""
        away = ~self.test.tested[self.baseline.sessions :]
        return int(np.argmin(np.append(away[::-1], False)))

    def trend(self) -> IndicatorTrend:
        """Convert to the trend that is drawn."""
        return IndicatorTrend(
            baseline=self.baseline,
            sessions=tuple(row.session for row in self.rows),
            compensated=_numbers(self.compensated),
            upward=_numbers(self.test.upward),
            downward=_numbers(self.test.downward),
        )

    def dated(self, alarm: int) -> Dated:
        """Date the change of an alarm, and determine its present size."""
        known = np.flatnonzero(np.isfinite(self.residuals))
        first, at = (int(np.searchsorted(known, each)) for each in (self.baseline.sessions, alarm))
        design, days = self.reference.design(covariates_of(self.rows)), _days(self.rows)
        residuals, expected = self.residuals[known], self.expected[known]
        found = dated(self.reference, residuals, expected, design[known], days[known], first, at)
        begins, low, high = (int(known[each]) for each in (found.begins, *found.interval))
        return Dated(**vars(found) | {"begins": begins, "interval": (low, high)})

    def until(self, count: int) -> "Tested":
        """Return the test as it was after the first ``count`` sessions."""
        own = {name: getattr(self, name)[:count] for name in ("rows", "values", "residuals", "expected")}
        return replace(self, **own)

    def change(self, alarm: int, found: Dated, plan: MonitorPlan, beside: tuple[str, ...]) -> Change:
        """Describe an alarm for a person."""
        level = abs(self.reference.level)
        percent = None if self.indicator == "half_sum_n" or level == 0.0 else 100.0 / level
        names, slopes = [row.session for row in self.rows], found.slope_interval
        low, high = found.interval
        limit, limits = self._limit(found, plan)
        return Change(
            indicator=self.indicator,
            change=found.change,
            interval=found.change_interval,
            percent=None if percent is None else percent * found.change,
            percent_interval=None if percent is None else _times(percent, found.change_interval),
            since=names[found.begins],
            since_interval=(names[low], names[high]),
            alarm_session=names[alarm],
            per_year=None if found.slope is None else found.slope * DAYS_A_YEAR,
            per_year_interval=None if slopes is None else _times(DAYS_A_YEAR, slopes),
            limit_reached=limit,
            limit_interval=limits,
            limit_passed=limit is not None and limit <= self.rows[-1].start[:10],
            beside=beside,
        )

    def _limit(self, found: Dated, plan: MonitorPlan) -> tuple[str | None, tuple[str | None, str | None] | None]:
        """Compute the date at which the user's limit is or was reached, with an interval."""
        percent, last = plan.limit_percent.get(self.indicator), self.rows[-1].start
        if percent is None or not last:
            return None, None
        sign = float(np.sign(found.change))
        limit = 0.01 * percent * abs(self.reference.level)
        left = limit - abs(found.change)
        if left <= 0.0:
            return self._passed(sign * self.residuals[found.begins :], limit, self.rows[found.begins :]), None
        if found.slope is None or found.slope_interval is None:
            return None, None

        def reached(slope: float) -> str | None:
            days = left / max(sign * slope, 1e-30)
            return f"{moment(last) + timedelta(days=days):%Y-%m-%d}" if days < FORESEEN_D else None

        slowest, fastest = sorted(found.slope_interval, key=lambda slope: sign * slope)
        return reached(found.slope), (reached(fastest), reached(slowest))

    def _passed(self, change: Array, limit: float, rows: Sequence[SessionRow]) -> str:
        """Find the date from which the means of a few sessions stay beyond a limit."""
        known = np.flatnonzero(np.isfinite(change))
        means = [change[known[max(place - FEW, 0) : place]].mean() for place in range(1, len(known) + 1)]
        within = np.flatnonzero(np.array(means) < limit)
        after = int(within[-1]) + 1 if len(within) else 0
        return rows[int(known[min(after, len(known) - 1)])].start[:10]


def tested(indicator: str, rows: Sequence[SessionRow], plan: MonitorPlan) -> Tested | str:
    """Test an indicator, or state why it has no baseline yet.

    ``rows`` are the cylinder's sessions in their order, from the beginning of the baseline on.
    """
    own = tuple(row for row in rows if _value(row, indicator) is not None)
    if len(own) < plan.baseline_sessions:
        reasons = [row.indicators[indicator].why for row in rows if _value(row, indicator) is None]
        why = f"; the latest of the others: {reasons[-1]}" if reasons and reasons[-1] else ""
        return f"{len(own)} of {len(rows)} sessions determine it; a baseline needs {plan.baseline_sessions}{why}"
    values = np.array([_value(row, indicator) for row in own], dtype=np.float64)
    uncertainties = np.array([row.indicators[indicator].uncertainty or 0.0 for row in own])
    # Half the sum may be about 0, and friction's asymmetry shifts it, so its priors are shares of friction.
    whole = "friction_n" if indicator == "half_sum_n" else indicator
    level = float(np.median([_value(row, whole) or 0.0 for row in own[: plan.baseline_sessions]]))
    return against_baseline(indicator, own, values, uncertainties, level, plan)


def against_baseline(
    indicator: str,
    rows: tuple[SessionRow, ...],
    values: Array,
    uncertainties: Array,
    level: float,
    plan: MonitorPlan,
    most: float = np.inf,
    least_scatter: float = 0.0,
) -> Tested | str:
    """Test one value per session, or state why there is no baseline.

    ``values`` and ``uncertainties`` have shape ``(sessions,)``; there are at least as many as the baseline needs. For
    ``level`` see ``reference.fitted``. ``most`` limits the expected value, and ``least_scatter`` the scatter.
    """
    first = slice(0, plan.baseline_sessions)
    if np.ptp(values[first]) > 0.0:
        reference = fitted(indicator, values[first], uncertainties[first], covariates_of(rows[first]), level)
    else:
        reference = Reference(level, 0.0, 0.0, 0.0, {}, np.ones(1), values[:1], np.zeros((1, 1)))
    reference = replace(reference, scatter=max(reference.scatter, least_scatter))
    if reference.scatter <= 1e-12 * abs(level):
        return "all sessions of the baseline have the same value, so that their scatter is not known"
    design = reference.design(covariates_of(rows))
    residuals = values - np.minimum(design @ reference.coefficients, most)
    test = cusum(reference, residuals, uncertainties, design, plan.baseline_sessions)
    days = float(np.ptp(_days(rows)))
    per_year = (len(rows) - 1) * DAYS_A_YEAR / days if days > 0.0 else DAYS_A_YEAR
    rate = plan.false_alarms_per_year / len(TESTED)
    baseline = Baseline(
        sessions=plan.baseline_sessions,
        first=rows[0].session,
        last=rows[plan.baseline_sessions - 1].session,
        level=reference.level,
        scatter=reference.scatter,
        autocorrelation=reference.autocorrelation,
        threshold=threshold(plan.baseline_sessions, reference.autocorrelation, rate, per_year),
        false_alarms_per_year=plan.false_alarms_per_year,
        smallest=test.smallest,
        reference=dict(reference.centre),
    )
    expected = reference.uncertainty(np.nan_to_num(design))
    return Tested(indicator, rows, values, residuals, expected, reference, test, baseline)


def untested(indicator: str, rows: Sequence[SessionRow], why: str) -> IndicatorTrend:
    """Make the trend of an indicator without a baseline: its values as they are."""
    own = [row for row in rows if _value(row, indicator) is not None]
    values = tuple(_value(row, indicator) for row in own)
    nothing = (None,) * len(own)
    return IndicatorTrend(None, tuple(row.session for row in own), values, nothing, nothing, why)


def _days(rows: Sequence[SessionRow]) -> Array:
    """Compute when sessions began, in days; without starts, assume one session per day."""
    if not all(row.start for row in rows):
        return np.arange(len(rows), dtype=np.float64)
    return np.array([moment(row.start).timestamp() / 86400.0 for row in rows])


def _value(row: SessionRow, indicator: str) -> float | None:
    return row.indicators[indicator].value


def _times(factor: float, interval: tuple[float, float]) -> tuple[float, float]:
    return factor * interval[0], factor * interval[1]


def _numbers(values: Array) -> tuple[float | None, ...]:
    return tuple(float(value) if np.isfinite(value) else None for value in values)
