"""Test one indicator of a cylinder against its baseline, and describe the change behind an alarm."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta

import numpy as np

from cylinder_friction_monitoring.arrays import Array
from cylinder_friction_monitoring.trends.assessment import Baseline, Change, IndicatorTrend
from cylinder_friction_monitoring.trends.cusum import Cusum, cusum, threshold
from cylinder_friction_monitoring.trends.dating import Z95, Dated, dated
from cylinder_friction_monitoring.trends.plan import MonitorPlan
from cylinder_friction_monitoring.trends.reference import Reference, covariates_of, fitted
from cylinder_friction_monitoring.trends.session_row import INDICATORS, SessionRow

TESTED = tuple(INDICATORS)  # Indicators that share the stated rate of false alarms
DAYS_A_YEAR = 365.25
FEW = 5  # Number of latest sessions whose mean shows a sudden change early
BEYOND = 5
"""Number of latest sessions in a row too far from the baseline at which the present state is unknown."""


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
    per_year: float  # Sessions per year

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
        own = self.residuals[known], self.expected[known], self.reference.design(covariates_of(self.rows))[known]
        found = dated(self.reference, *own, first, at)
        begins, low, high = (int(known[each]) for each in (found.begins, *found.interval))
        return Dated(**vars(found) | {"begins": begins, "interval": (low, high)})

    def until(self, count: int) -> "Tested":
        """Return the test as it was after the first ``count`` sessions."""
        own = {name: getattr(self, name)[:count] for name in ("rows", "values", "residuals", "expected")}
        return replace(self, **own)

    def latest(self, found: Dated) -> tuple[float, float]:
        """Bound the present change of an alarm from below and above, in the indicator's unit.

        The mean of the last few sessions follows sudden growth sooner than a fitted step or trend.
        """
        values = self.residuals[np.isfinite(self.residuals)][-FEW:]
        few = abs(float(values.mean()))
        return max(abs(found.change), few - self._wide(len(values))), max(*map(abs, found.change_interval), few)

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
            per_year=None if found.slope is None else found.slope * self.per_year,
            per_year_interval=None if slopes is None else _times(self.per_year, slopes),
            limit_reached=limit,
            limit_interval=limits,
            limit_passed=limit is not None and limit <= self.rows[-1].start[:10],
            beside=beside,
        )

    def _limit(self, found: Dated, plan: MonitorPlan) -> tuple[str | None, tuple[str | None, str | None] | None]:
        """Compute the date at which the user's limit is or was reached, with an interval."""
        percent, now = plan.limit_percent.get(self.indicator), _time(self.rows[-1].start)
        if percent is None or now is None:
            return None, None
        sign = float(np.sign(found.change))
        limit = 0.01 * percent * abs(self.reference.level)
        left = limit - abs(found.change)
        if left <= 0.0:
            return self._passed(sign * self.residuals[found.begins :], limit, self.rows[found.begins :])
        if found.slope is None or found.slope_interval is None:
            return None, None

        def reached(slope: float) -> str | None:
            years = left / (sign * slope * self.per_year) if sign * slope > 0.0 else np.inf
            return (now + timedelta(days=DAYS_A_YEAR * years)).date().isoformat() if years < 100.0 else None

        slowest, fastest = sorted(found.slope_interval, key=lambda slope: sign * slope)
        return reached(found.slope), (reached(fastest), reached(slowest))

    def _passed(
        self, change: Array, limit: float, rows: Sequence[SessionRow]
    ) -> tuple[str, tuple[str | None, str | None]]:
        """Find the date from which the means of a few sessions stay beyond a limit, with an interval."""
        known = np.flatnonzero(np.isfinite(change))
        sums, counts = np.cumsum(change[known]), np.minimum(np.arange(len(known)) + 1, FEW)
        sums[FEW:] -= sums[:-FEW].copy()
        starts = [rows[int(each)].start[:10] for each in known]
        wide = self._wide(FEW)

        def since(beyond: float) -> str:
            within = np.flatnonzero(sums / counts < beyond)
            return starts[min(int(within[-1]) + 1 if len(within) else 0, len(starts) - 1)]

        return since(limit), (since(limit - wide), since(limit + wide))

    def _wide(self, count: int) -> float:
        """Compute half the 95 % interval of the mean of neighbouring sessions."""
        phi = self.reference.autocorrelation
        return Z95 * self.reference.scatter * float(np.sqrt((1.0 + phi) / (1.0 - phi) / count))


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
    per_year = sessions_per_year(rows)
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
    return Tested(indicator, rows, values, residuals, expected, reference, test, baseline, per_year)


def untested(indicator: str, rows: Sequence[SessionRow], why: str) -> IndicatorTrend:
    """Make the trend of an indicator without a baseline: its values as they are."""
    own = [row for row in rows if _value(row, indicator) is not None]
    values = tuple(_value(row, indicator) for row in own)
    nothing = (None,) * len(own)
    return IndicatorTrend(None, tuple(row.session for row in own), values, nothing, nothing, why)


def sessions_per_year(rows: Sequence[SessionRow]) -> float:
    """Count the sessions per year from the first and last start; without starts, assume one per day."""
    first, last = _time(rows[0].start), _time(rows[-1].start)
    days = 0.0 if first is None or last is None else (last - first).total_seconds() / 86400.0
    return (len(rows) - 1) * DAYS_A_YEAR / days if days > 0.0 else DAYS_A_YEAR


def _value(row: SessionRow, indicator: str) -> float | None:
    return row.indicators[indicator].value


def _time(start: str) -> datetime | None:
    """Parse a start without its time zone, because only the time between sessions of one clock matters."""
    return datetime.fromisoformat(start).replace(tzinfo=None) if start else None


def _times(factor: float, interval: tuple[float, float]) -> tuple[float, float]:
    return factor * interval[0], factor * interval[1]


def _numbers(values: Array) -> tuple[float | None, ...]:
    return tuple(float(value) if np.isfinite(value) else None for value in values)
