"""Assess a cylinder: one of five answers, from the tests of all its indicators."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime

import numpy as np

from cylinder_friction_monitoring.trends import sentences
from cylinder_friction_monitoring.trends.assessment import Answer, Assessment, Change, Entry
from cylinder_friction_monitoring.trends.beside import changed_beside, farthest
from cylinder_friction_monitoring.trends.dating import Dated
from cylinder_friction_monitoring.trends.in_force import InForce, in_force, why_it_returns
from cylinder_friction_monitoring.trends.moments import moment
from cylinder_friction_monitoring.trends.plan import MonitorPlan
from cylinder_friction_monitoring.trends.reference import covariates_of
from cylinder_friction_monitoring.trends.retraining import model_bounds
from cylinder_friction_monitoring.trends.session_row import INDICATORS, SessionRow
from cylinder_friction_monitoring.trends.trend import BEYOND, TESTED, Tested, tested, untested

UNSEEN_OIL_PERCENT = 25.0  # Largest change of friction by oil if its temperature is not measured [%]
LEAK_BY_ZERO = 4.0  # Largest factor on the leak by a shifted zero, if pressures differ by a few bar
BY_OIL = 0.3  # Least share of a change of friction that viscous friction explains if oil is the likely cause
ZERO_MOVED = 4.0  # Least shift of a zero that explains a leak [standard deviations of a session]
RETURN_Z = 6.0
RETURN_SHARE = 0.5
RETURN_SESSIONS = 4
"""Limits of a return to the baseline: least step in standard deviations, largest share of the change that remains, and
least number of sessions before and after it."""


@dataclass(frozen=True)
class _Alarm:
    """One indicator's alarm."""

    test: Tested
    at: int  # Session of the alarm
    dated: Dated
    returned: int | None  # Session at which it came back towards the baseline

    @property
    def name(self) -> str:
        return self.test.indicator

    @property
    def better(self) -> bool:
        """Whether the cylinder is better than before: less leak, a smoother bore, or back near its baseline."""
        falls = self.dated.change < 0.0 and self.name in ("leak_m3_s_pa", "profile_n")
        return falls or self.returned is not None

    def with_(self, other: "_Alarm") -> bool:
        """Check whether both changes may have begun together."""
        return self.not_after(other) and other.not_after(self)

    def not_after(self, other: "_Alarm") -> bool:
        """Check whether this change may have begun before the other, or with it."""
        first, last = self.dated.interval[0], other.dated.interval[1]
        return self.test.rows[first].start <= other.test.rows[last].start


def assess(
    cylinder: str,
    rows: Sequence[SessionRow],
    entries: Sequence[Entry] = (),
    plan: MonitorPlan | None = None,
    now: datetime | None = None,
) -> Assessment:
    """Assess a cylinder by its sessions and entries; those of other cylinders are ignored.

    ``rows`` may be in any order; sessions without a start come last. The baseline begins at the latest service, reset
    or reference in force at ``now``. With None, all dates are in the past, and no acknowledgement has ended.
    """
    plan = plan or MonitorPlan()
    own = [row for row in rows if row.cylinder == cylinder]
    stated = [each for each in entries if each.cylinder == cylinder]
    force = in_force(stated, [row.start for row in own], now, plan.acknowledged_days)
    current = _since(own, force.begins)
    results = {name: tested(name, current, plan) for name in TESTED}
    moving = {
        name: sentences.moving(name, test.baseline, test.reference.moved)
        for name, test in results.items()
        if isinstance(test, Tested) and test.reference.moved
    }
    results |= moving
    trends = {
        name: result.trend() if isinstance(result, Tested) else untested(name, current, result)
        for name, result in results.items()
    }
    tests = {name: result for name, result in results.items() if isinstance(result, Tested)}
    alarms = [_alarm(test, test.alarm, current) for test in tests.values() if test.alarm is not None]
    if set(tests) <= {"half_sum_n"}:
        found = _not_yet(cylinder, current, results, plan)
    elif alarms:
        found = _changed(cylinder, alarms, force, plan)
    else:
        found = _quiet(cylinder, tests)
    if moving and found.answer != "alarm":
        words, decide = next(iter(moving.values())), (sentences.STEADY, *found.would_decide)
        found = replace(found, answer="undecided", words=words, would_decide=decide)
    everything = _since(own, "")

    def worn() -> bool:  # acknowledged alarms count, too
        return bool(alarms) and _changed(cylinder, alarms, InForce(), plan).answer == "alarm"

    questions = (*found.questions, *(why for why in moving.values() if why != found.words), *force.waiting)
    return replace(found, trends=trends, questions=questions, model=model_bounds(everything, tests, worn, plan))


def _since(rows: Sequence[SessionRow], begins: str) -> list[SessionRow]:
    """Sort sessions, and drop those before the time ``begins``, if any."""
    ordered = sorted((row for row in rows if row.start), key=lambda row: moment(row.start))
    if begins:
        ordered = [row for row in ordered if moment(row.start) >= moment(begins)]
    return ordered + [row for row in rows if not row.start]


def _alarm(test: Tested, at: int, rows: Sequence[SessionRow]) -> _Alarm:
    dated = test.dated(at)
    if test.rows[-1] not in rows[-BEYOND:]:  # such as a cylinder at rest: the rate would be a former one
        dated = replace(dated, slope=None, slope_interval=None)
    return _Alarm(test, at, dated, _returned(test, at))


def _returned(test: Tested, at: int) -> int | None:
    """Find the session after the alarm at which an indicator stepped back towards its baseline."""
    values = test.residuals[at:]
    known = np.flatnonzero(np.isfinite(values))
    if len(known) < 2 * RETURN_SESSIONS:
        return None
    values, phi = values[known], test.reference.autocorrelation
    counts = np.arange(RETURN_SESSIONS, len(values) - RETURN_SESSIONS + 1)
    sums = np.cumsum(values)
    before = sums[counts - 1] / counts
    after = (sums[-1] - sums[counts - 1]) / (len(values) - counts)
    spread = test.reference.scatter * np.sqrt((1.0 + phi) / (1.0 - phi) * (1.0 / counts + 1.0 / (len(values) - counts)))
    toward = -np.sign(before) * (after - before)
    best = int(np.argmax(toward / spread))
    enough = toward[best] > RETURN_Z * spread[best] and abs(after[best]) < RETURN_SHARE * abs(before[best])
    return at + int(known[counts[best]]) if enough else None


def _not_yet(cylinder: str, rows: Sequence[SessionRow], results: Mapping[str, object], plan: MonitorPlan) -> Assessment:
    why = results["friction_n"]
    known = (name for row in rows for name, each in row.indicators.items() if each.value is not None)
    there = max((count for name, count in Counter(known).items() if name != "half_sum_n"), default=0)
    words = sentences.not_yet(there, plan.baseline_sessions, plan.assumed_scatter, why if isinstance(why, str) else "")
    return Assessment(cylinder, "not yet", words)


def _quiet(cylinder: str, tests: Mapping[str, Tested]) -> Assessment:
    """Assess a cylinder for which no test exceeds its threshold."""
    main = next(tests[name] for name in TESTED if name in tests)
    monitored = len(main.rows) - main.baseline.sessions
    away = {name: test for name, test in tests.items() if test.beyond >= BEYOND and name != "half_sum_n"}
    if main.indicator in away:
        design = main.reference.design(covariates_of(main.rows[-1:]))[0]
        reason = farthest(main.reference.centre, design, main.reference.covariance, main.rows[-1])
        decide = ("sessions under the conditions of the baseline", "a new reference, if the present conditions stay")
        words = f"The last {main.beyond} sessions cannot be compared with the baseline: {reason}."
        return Assessment(cylinder, "undecided", words, would_decide=decide)
    watched = [name for name, test in tests.items() if test.watched]
    if watched:
        names = ", ".join(INDICATORS[name].title for name in watched)
        words = f"{names[0].upper()}{names[1:]} differs from the baseline, not yet by enough for an alarm."
        return Assessment(cylinder, "watch", words)
    title, smallest = INDICATORS[main.indicator].title, 100.0 * main.baseline.smallest / abs(main.reference.level)
    smallest = max(smallest, 1.0)
    words = f"No change of {title} in {monitored} sessions; lasting changes below {smallest:.0f} % cannot be found."
    return Assessment(cylinder, "fine", words if monitored else "The baseline is complete; monitoring begins.")


def _changed(cylinder: str, alarms: Sequence[_Alarm], force: InForce, plan: MonitorPlan) -> Assessment:
    """Assess a cylinder for which at least one test exceeds its threshold."""
    zero = next((each for each in alarms if each.name == "half_sum_n"), None)
    oil = next((each for each in alarms if each.name == "viscous_n_s_m"), None)
    doubts = {each.name: _doubts(each, zero, oil) for each in alarms}
    changes = {each.name: _change(each, zero, plan) for each in alarms}
    wear = [each for each in alarms if not doubts[each.name] and not each.better]
    better = [each for each in alarms if each.better and not doubts[each.name]]
    # While friction is worse than its baseline, only its return suggests a new seal. A smoother bore or less leakage
    # does not, because wear can cause them as well.
    returned = [each for each in better if each.returned is not None]
    if better and (not wear or (returned and all(each.at < (returned[0].returned or 0) for each in wear))):
        main = (returned or better)[0]
        at = main.test.rows[main.returned or main.dated.begins].session
        question = f"was the seal changed before session {at}? Enter it as a service, and a new baseline begins there"
        words = sentences.better(changes[main.name], at)
        return Assessment(cylinder, "watch", words, tuple(changes.values()), questions=(question,))
    if wear:
        worn = [changes[each.name] for each in wear]
        rest = [change for change in changes.values() if change not in worn]
        quiet, back = _acknowledged(wear, force, plan)
        answer: Answer = "watch" if quiet else "alarm"
        words = f"{sentences.alarm(worn)}{back}"
        at = worn[0].since
        stepped = next(each for each in wear).dated.step
        asked = (f"was anything changed at session {at}, such as seals, oil or load? Enter it",) if stepped else ()
        return Assessment(cylinder, answer, words, (*worn, *rest), questions=asked, acknowledged=quiet)
    main = next((each for each in alarms if each.name not in ("half_sum_n", "leak_m3_s_pa")), zero or alarms[0])
    decide = tuple(dict.fromkeys(doubt for own in doubts.values() for doubt in own))
    change = changes[main.name]
    words = sentences.zero_moved(change) if main is zero else sentences.doubtful(change, decide)
    return Assessment(cylinder, "undecided", words, tuple(changes.values()), would_decide=decide)


def _acknowledged(wear: Sequence[_Alarm], force: InForce, plan: MonitorPlan) -> tuple[str, str]:
    """State who acknowledged an alarm (empty if it is new or has returned), and add a sentence on it."""
    seen, latest = force.acknowledged, max(each.test.rows[each.at].start for each in wear)
    if seen is None or not latest or moment(seen.time) < moment(latest):
        return "", ""
    by = f" Acknowledged by {seen.name} on {seen.time[:10]}"
    reasons = [why_it_returns(each.test, each.at, each.dated, seen, plan) for each in wear]
    why = f"its time is over since {force.over[:10]}" if force.over else next(filter(None, reasons), "")
    if why:
        return "", f"{by}, and back: {why}."
    return f"{seen.name}, {seen.time[:10]}{seen.stated and ': '}{seen.stated}", f"{by}."


def _doubts(alarm: _Alarm, zero: _Alarm | None, oil: _Alarm | None) -> tuple[str, ...]:
    """List what would decide whether a change is wear; empty if that is decided."""
    if alarm is oil:
        return (sentences.OIL,)
    if alarm.name == "half_sum_n":
        return sentences.VENTED, "the load, measured or known to be the same"
    # A new load or new oil also explains a later change, because the test of friction is slower.
    explained = zero is not None and zero.not_after(alarm)
    level = abs(alarm.test.reference.level)
    if alarm.name == "leak_m3_s_pa":
        small = abs(alarm.dated.change) < (LEAK_BY_ZERO - 1.0) * max(level, alarm.test.reference.scatter)
        moved = zero is not None and abs(zero.dated.change) > ZERO_MOVED * zero.test.reference.scatter
        return (sentences.VENTED,) if moved and small else ()
    doubts = []
    unseen = "oil_temperature_c" not in alarm.test.reference.centre
    if unseen and abs(alarm.dated.change) < 0.01 * UNSEEN_OIL_PERCENT * level:
        doubts.append("a temperature sensor in the oil: cold oil changes friction as much")
    if explained and zero is not None and abs(zero.dated.change) > abs(alarm.dated.change):
        doubts.append("the load, measured: it, or a transmitter, changed before or at the same time")
    if oil is not None and oil.not_after(alarm) and alarm.name != "profile_n":
        speed = alarm.test.reference.centre.get("speed_m_s", 0.0)
        if oil.dated.change * speed / alarm.dated.change > BY_OIL:
            doubts.append(sentences.OIL)
    return tuple(doubts)


def _change(alarm: _Alarm, zero: _Alarm | None, plan: MonitorPlan) -> Change:
    moved = None
    if zero is not None and zero is not alarm and zero.with_(alarm):
        low, high = zero.dated.change_interval
        moved = zero.dated.change, 0.5 * (high - low)
    beside = changed_beside(alarm.test.rows, alarm.dated.begins, moved)
    return alarm.test.change(alarm.at, alarm.dated, plan, beside)
