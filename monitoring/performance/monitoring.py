"""Whether alarms of monitoring can be believed: false alarms, delays and dates over lives, beside other tests.

    python monitoring/performance/monitoring.py [--seed 7] [--scratch FOLDER] [--kept] [--servo]

The rig simulates seven cylinders in full: a year in 96 sessions, and each disturbance; two of them also with faults.
The scratch folder keeps their rows, so that a second run takes minutes. Longer lives with a session a day, and more of
them, are resampled from these rows (``Resampled``). Tables give medians, with the 90 % quantile in brackets.

With ``--servo`` the servo rig of ``benchmark``, whose package this needs, simulates two healthy cylinders instead: 96
sessions each, with friction that differs by 5 % from session to session.
"""

from __future__ import annotations

import argparse
import importlib
import json
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from datetime import datetime, timedelta
from functools import partial
from pathlib import Path
from typing import cast

import numpy as np
import pandas as pd
from scipy import stats
from scipy.signal import lfilter

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.files.whole_files import write_json
from cylinder_friction.labelling.label import label
from cylinder_friction.recordings.columns import OIL_TEMPERATURE, POSITION, PRESSURES, TIME
from cylinder_friction.recordings.recording import Recording
from cylinder_friction_monitoring.lives import Fate, LifePlan, life
from cylinder_friction_monitoring.trends.assessment import Entry
from cylinder_friction_monitoring.trends.indicators import session_row
from cylinder_friction_monitoring.trends.plan import MonitorPlan
from cylinder_friction_monitoring.trends.session_row import Indicator, SessionRow
from cylinder_friction_monitoring.trends.trend import TESTED, Tested, tested
from cylinder_friction_monitoring.trends.verdict import assess

CYLINDER = Cylinder(bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0)
UNITS = {TIME: 1.0, PRESSURES[0]: 1e5, PRESSURES[1]: 1e5, POSITION: 1e-3, OIL_TEMPERATURE: 1.0}
STEP_S = 1e-4  # Of the integration
HEALTHY, FAULTY, SIMULATED_YEAR, BLOCK, YEAR = 7, 2, 96, 6, 365
# How many sessions are simulated, and within how many the change is complete: of every cylinder, and of ``FAULTY``
DISTURBANCES = {"drift": (130, 100), "oil": (40, 1), "load": (40, 1), "duty": (40, 1)}
FAULTS = {"leak": (100, 80), "wear": (100, 100), "seal": (120, 100)}
FATES = DISTURBANCES | FAULTS
BEFORE = 100  # Healthy sessions between baseline and change
CHANGES = {"step 5 %": (0.05, 1), "step 10 %": (0.1, 1), "step 20 %": (0.2, 1)}
CHANGES |= {"10 % in 100": (0.1, 100), "10 % in 300": (0.1, 300)}
LIMIT_PERCENT = 20.0  # Of friction, in years in which every alarm is acknowledged
FRICTION = ("friction_n", "breakaway_n")
LATER = (1, 2, 5, 10, 20, 50, 100)  # Sessions after an indicator's alarm at which the answer is looked at again
Rows = list[SessionRow]
Bank = dict[tuple[str, int], Rows]


def simulated(seed: int, scratch: Path, case: tuple[str, int]) -> Rows:
    """Return the rows of a cylinder's sessions, simulated unless an earlier run kept them."""
    fate, number = case
    path = scratch / f"{fate}_{number:02d}_{seed}.json"
    if fate == "servo" and not path.is_file():
        rig = importlib.import_module("friction_benchmark.servo_rig.sessions")
        plan = rig.SessionPlan(seed=100 * seed + number, sample_time_s=0.005)
        made = (rig.record(plan, "2", each).recording for each in range(1, SIMULATED_YEAR + 1))
        write_json(path, [session_row(label([each], rig.CYLINDER), rig.CYLINDER).to_dict() for each in made])
    elif not path.is_file():
        lived = LifePlan(seed, SIMULATED_YEAR, SIMULATED_YEAR, 1, SIMULATED_YEAR, time_step_s=STEP_S)
        if fate != "healthy":
            lived = LifePlan(seed, FATES[fate][0], 0, FATES[fate][1], time_step_s=STEP_S)
        rows = []
        for each in life(CYLINDER, lived, number, cast(Fate, fate)):
            named = zip(UNITS.items(), each.logger.columns, strict=True)
            table = pd.DataFrame({name: unit * each.logger[column] for (name, unit), column in named})
            rows.append(session_row(label([Recording(each.metadata, table)], CYLINDER), CYLINDER))
        write_json(path, [row.to_dict() for row in rows])
    rows = [SessionRow.from_dict(each) for each in json.loads(path.read_text())]
    return [row for row in rows if row.covariates["oil_temperature_c"] is not None]  # Others have no matched stroke


class Resampled:
    """Lives of a cylinder with a session a day, from its simulated sessions.

    Sessions are drawn in blocks of six neighbours. Their oil gets the temperature of a season, and each indicator
    changes with it as a parabola through all sessions of the cylinder's healthy year does.
    """

    def __init__(self, year: Rows) -> None:
        self.year, self.oil_c = year, _oil_c(year)
        self.effects = {}
        for name in TESTED:
            values = np.array([row.indicators[name].value for row in year], dtype=np.float64)
            known = np.isfinite(values)
            self.effects[name] = np.polyfit(self.oil_c[known], values[known], 2)

    def days(self, count: int, ends: float, generator: np.random.Generator) -> Rows:
        """Return ``count`` healthy sessions, one a day, the last on day ``ends`` of a year that is cold in winter."""
        return self.seasonal(_blocks(self.year, count, generator), ends, generator)

    def seasonal(self, sessions: Rows, ends: float, generator: np.random.Generator) -> Rows:
        """Return sessions, one a day, with the oil temperature of their day."""
        count, was_c = len(sessions), _oil_c(sessions)
        season = np.sin(2.0 * np.pi * (np.arange(count) - count + ends) / YEAR)
        oil_c = 36.0 + 7.0 * season + lfilter([1.2], [1.0, -0.5], generator.normal(0.0, 1.8, count))
        oil_c = np.clip(oil_c, self.oil_c.min(), self.oil_c.max())
        changes = {name: np.polyval(own, oil_c) - np.polyval(own, was_c) for name, own in self.effects.items()}
        rows = []
        for day, row in enumerate(sessions):
            own = {}
            for name, each in row.indicators.items():
                value = None if each.value is None else each.value + float(changes[name][day])
                own[name] = Indicator(value, each.uncertainty, each.why)
            covariates = {**row.covariates, "oil_temperature_c": float(oil_c[day])}
            rows.append(replace(row, indicators=own, covariates=covariates))
        return daily(rows)


def _oil_c(rows: Rows) -> Array:
    return np.array([row.covariates["oil_temperature_c"] for row in rows], dtype=np.float64)


def _blocks(rows: Rows, count: int, generator: np.random.Generator) -> Rows:
    """Draw ``count`` sessions in blocks of neighbours."""
    begins = generator.integers(0, len(rows), -(-count // BLOCK))
    return [rows[place] for place in (begins[:, None] + np.arange(BLOCK)).ravel()[:count] % len(rows)]


def disturbed(bank: Bank, kind: str, number: int, turn: int, plan: MonitorPlan) -> Rows:
    """Return baseline and a year of a healthy cylinder that is disturbed from some day of the year on."""
    generator = np.random.default_rng([1, number, turn, list(DISTURBANCES).index(kind)])
    healthy, own = Resampled(bank["healthy", number]), bank[kind, number]
    comes, ends = int(generator.integers(30, YEAR - 60)), float(generator.integers(YEAR))
    left, (_, within) = YEAR - comes, DISTURBANCES[kind]
    changing = own[:within] if within > 1 else []
    after = (changing + _blocks(own[len(changing) :], left, generator))[:left]
    before = healthy.days(plan.baseline_sessions + comes, ends - left, generator)
    return daily(before + healthy.seasonal(after, ends, generator))


def daily(rows: Sequence[SessionRow]) -> Rows:
    """Return sessions as one a day, named by their number."""
    starts = [f"{datetime(2025, 1, 6, 6) + timedelta(days=day):%Y-%m-%dT%H:%M:%S}Z" for day in range(len(rows))]
    return [replace(row, session=f"{day}", start=starts[day]) for day, row in enumerate(rows)]


def grown(rows: Rows, change: float, within: int, begins: int) -> Rows:
    """Return rows whose friction grows from session ``begins`` on."""
    found = []
    for day, row in enumerate(rows):
        factor, own = 1.0 + change * min(max((day - begins + 1) / within, 0.0), 1.0), dict(row.indicators)
        for name in FRICTION:
            value = own[name].value
            own[name] = replace(own[name], value=None if value is None else factor * value)
        found.append(replace(row, indicators=own))
    return found


def nights(rows: Rows, plan: MonitorPlan) -> list[tuple[int, str, str]]:
    """Return session, result and main indicator: when an indicator alarms, some sessions later, and at the end."""
    last = len(rows) - 1
    found = {last: assess(CYLINDER.name, rows, (), plan)}
    for trend in next(iter(found.values())).trends.values():
        sums = np.array([trend.upward, trend.downward], dtype=np.float64)
        over = np.flatnonzero(np.fmax(*sums) > (trend.baseline.threshold if trend.baseline else np.inf))
        for day in [int(trend.sessions[over[0]]) + later for later in (0, *LATER)] if len(over) else ():
            if day < last and day not in found:
                found[day] = assess(CYLINDER.name, rows[: day + 1], (), plan)
    ordered = sorted(found.items())
    return [(day, each.answer, each.changes[0].indicator if each.changes else "") for day, each in ordered]


def lives(healthy: list[Resampled], times: int, count: int, seed: int) -> Iterator[Rows]:
    for number, year in enumerate(healthy):
        for turn in range(times):
            generator = np.random.default_rng([seed, number, turn])
            yield year.days(count, float(generator.integers(YEAR)), generator)


def undisturbed(healthy: list[Resampled], times: int, plan: MonitorPlan) -> None:
    """Print how often an alarm is given in healthy lives without a disturbance."""
    years = list(lives(healthy, times, plan.baseline_sessions + YEAR, 5))
    with ProcessPoolExecutor(2) as pool:
        given = list(pool.map(partial(_nights_after, plan.baseline_sessions), years, chunksize=8))
    wrong = Counter(name for each in given for _, result, name in [e for e in each if e[1] == "alarm"][:1])
    print(f"baseline {plan.baseline_sessions:3d}: {_rate(wrong.total(), len(years))} {dict(wrong)}")


def _rate(count: int, years: int) -> str:
    most = stats.chi2.ppf(0.975, 2 * count + 2) / 2.0 / years
    return f"{count / years:.4f} a cylinder-year, at most {most:.4f} ({years} years)"


def _nights_after(baseline: int, rows: Rows) -> list[tuple[int, str, str]]:
    return nights(rows, MonitorPlan(baseline_sessions=baseline))


def _nights_of(bank: Bank, baseline: int, case: tuple[str, int, int]) -> list[tuple[int, str, str]]:
    return _nights_after(baseline, disturbed(bank, *case, MonitorPlan(baseline_sessions=baseline)))


def false_alarms(bank: Bank, healthy: int, times: int, plan: MonitorPlan) -> None:
    """Print how often wear or a leak is named in healthy lives, each with one disturbance in its year."""
    cases = [(kind, number, turn) for kind in DISTURBANCES for number in range(healthy) for turn in range(times)]
    with ProcessPoolExecutor(2) as pool:
        given = list(pool.map(partial(_nights_of, bank, plan.baseline_sessions), cases, chunksize=len(cases) // 4))
    wrong, undecided, last = Counter[tuple[str, str]](), Counter[str](), Counter[str]()
    for (kind, _, _), each in zip(cases, given, strict=True):
        wrong.update([(kind, name) for _, result, name in each if result == "alarm"][:1])
        undecided[kind] += any(result == "undecided" for _, result, _ in each)
        last[each[-1][1]] += 1
    print(f"baseline {plan.baseline_sessions:3d}: {_rate(wrong.total(), len(cases))} {dict(wrong)};", flush=True)
    each_kind = len(cases) // len(DISTURBANCES)
    print(f"  undecided by kind, of {each_kind}: {dict(undecided)};", _ends(undecided.total(), last))


def _ends(undecided: int, last: Counter[str]) -> str:
    in_the_end = ", ".join(f"{name} {100 * count / last.total():.0f} %" for name, count in last.most_common())
    return f"undecided at some time {100 * undecided / last.total():.0f} %; in the end {in_the_end}"


def quantiles(values: Sequence[float]) -> str:
    known = np.where(np.isnan(values), np.inf, values) if len(values) else [np.nan]
    return f"{np.quantile(known, 0.5, method='higher'):.0f} ({np.quantile(known, 0.9, method='higher'):.0f})"


def delays(healthy: list[Resampled], plan: MonitorPlan) -> None:
    begins = plan.baseline_sessions + BEFORE
    for name, change in CHANGES.items():
        found, errors, growth, held, early = list[float](), list[float](), list[float](), list[bool](), 0
        for healthy_rows in lives(healthy, 4, begins + YEAR, 3):
            rows = grown(healthy_rows, *change, begins)
            tests = [test for name in FRICTION if isinstance(test := tested(name, rows, plan), Tested)]
            first = [(int(test.rows[test.alarm].session), test) for test in tests if test.alarm is not None]
            day, test = min(first, key=lambda each: each[0], default=(-1, tests[0]))
            if not first:
                found.append(np.nan)
                continue
            early += day < begins
            if day >= begins:
                found.append(day - begins + 1.0)
                growth.append(100.0 * change[0] * min((day - begins + 1) / change[1], 1.0))
                dated = test.dated(cast(int, test.alarm))
                start, low, high = (int(test.rows[each].session) for each in (dated.begins, *dated.interval))
                errors.append(abs(start - begins))
                held.append(low <= begins <= high)
        text = f"{name:12s} found {100 * len(errors) / len(found):3.0f} %, after {quantiles(found)} sessions, grown by"
        dates = f"date off by {quantiles(errors)}, its interval holds {100 * np.mean(held):.0f} %"
        print(f"{text} {np.median(growth):.1f} %; {dates}; alarms before it began: {early}")


def fates(bank: Bank, plan: MonitorPlan) -> None:
    """Print what becomes of cylinders with something wrong, fully simulated after a resampled healthy time."""
    begins = plan.baseline_sessions + BEFORE
    for fate in sorted({each for each, _ in bank if each in FATES}):
        last, days, main, undecided = Counter[str](), list[float](), Counter[str](), 0
        for number, turn in ((number, turn) for each, number in bank if each == fate for turn in range(5)):
            before = Resampled(bank["healthy", number]).days(begins, 0.0, np.random.default_rng([4, number, turn]))
            given = [each for each in nights(daily(before + bank[fate, number]), plan) if each[0] >= begins]
            alarmed = [(day, name) for day, result, name in given if result == "alarm"]
            days.append(alarmed[0][0] - begins + 1.0 if alarmed else np.nan)
            main.update(name for _, name in alarmed[:1])
            undecided += any(result == "undecided" for _, result, _ in given)
            last[given[-1][1]] += 1
        alarm = f"alarm {100 * main.total() / last.total():3.0f} % {dict(main)}, after {quantiles(days)};"
        print(f"{fate:6s}{alarm}", _ends(undecided, last))


def acknowledged(healthy: list[Resampled], count: int, plan: MonitorPlan) -> None:
    """Print how long wear beyond the limit stays quiet in years in which every alarm is acknowledged at once."""
    plan = replace(plan, limit_percent={"friction_n": LIMIT_PERCENT})
    with ProcessPoolExecutor(2) as pool:
        found = list(pool.map(partial(_acknowledged, healthy, plan), range(count), chunksize=5))
    longest, alarms, quiet = zip(*found, strict=True)
    worst = ", ".join(f"{length} sessions {n}" for length, n in sorted(Counter(longest).items(), reverse=True)[:3])
    print(
        f"every alarm acknowledged at once, limit {LIMIT_PERCENT:g} %, {count} years: longest quiet beyond the limit, "
        f"years by length: {worst}; alarms a year {quantiles(alarms)}, quiet below the limit {np.mean(quiet):.0f} %"
    )


def _acknowledged(healthy: list[Resampled], plan: MonitorPlan, number: int) -> tuple[int, float, float]:
    """Return the longest quiet beyond the limit, the alarms, and how many sessions between them were quiet [%]."""
    generator = np.random.default_rng([6, number])
    begins, days = plan.baseline_sessions + int(generator.integers(10, BEFORE)), plan.baseline_sessions + YEAR
    change, within, power = generator.uniform(0.25, 1.2), int(generator.integers(1, 250)), generator.uniform(0.5, 3.0)
    rows = healthy[number % len(healthy)].days(days, float(generator.integers(YEAR)), generator)
    true = change * np.clip((np.arange(days) - begins + 1.0) / within, 0.0, 1.0) ** power
    true *= -1.0 if number % 3 == 0 and change < 0.9 else 1.0
    rows = [grown([row], float(each), 1, 0)[0] for row, each in zip(rows, true, strict=True)]
    beyond = 100.0 * np.abs(true) > LIMIT_PERCENT
    first = min(nights(rows, plan))[0]  # before this session there is no alarm
    silent = longest = int(beyond[:first].sum())
    entries, quiet = list[Entry](), list[bool]()
    for day in range(first, days):
        answer = assess(CYLINDER.name, rows[: day + 1], entries, plan, datetime.fromisoformat(rows[day].start)).answer
        silent = silent + 1 if beyond[day] and answer != "alarm" else 0
        longest = max(longest, silent)
        if entries and not beyond[day]:
            quiet.append(answer != "alarm")
        if answer == "alarm":
            entries.append(Entry(CYLINDER.name, rows[day].start, "performance", "acknowledge"))
    return longest, float(len(entries)), 100.0 * float(np.mean(quiet)) if quiet else 100.0


def page_hinkley(y: Array, first: int) -> Array:
    mean, scatter = np.cumsum(y) / np.arange(1, len(y) + 1), y[:first].std(ddof=1)
    sides = [np.cumsum(sign * (y - mean) - 0.5 * scatter) for sign in (1.0, -1.0)]
    return np.asarray(np.max([each - np.minimum.accumulate(each) for each in sides], axis=0) / scatter)


def adwin(y: Array, first: int) -> Array:
    """Return the greatest difference of the means of two parts of all sessions so far, in its standard deviations."""
    sums, found = np.cumsum(y), np.zeros(len(y))
    for n in range(first, len(y)):
        cut = np.arange(5, n - 4)
        difference = np.abs(sums[cut - 1] / cut - (sums[n] - sums[cut - 1]) / (n + 1 - cut))
        found[n] = (difference * np.sqrt(cut * (n + 1 - cut) / (n + 1.0))).max() / y[: n + 1].std()
    return found


OTHERS: dict[str, tuple[Callable[[Array, int], Array], float]] = {
    "3σ rule": (lambda y, n: np.abs(y - y[:n].mean()) / y[:n].std(ddof=1), 3.0),
    "fixed threshold, 10 %": (lambda y, n: np.abs(y / y[:n].mean() - 1.0), 0.1),
    "Page–Hinkley, 0.5σ, 5σ": (page_hinkley, 5.0),
    "ADWIN, δ = 0.002": (adwin, float(np.sqrt(2.0 * np.log(2.0 * YEAR / 0.002)))),
}


def others(healthy: list[Resampled], plan: MonitorPlan) -> None:
    """Print other tests, of friction alone, with their usual limit and with one that gives our rate of alarms."""
    n, wanted = plan.baseline_sessions, ("none", "step 10 %", "step 20 %", "10 % in 100")
    lists = {}
    for change in wanted:
        made = [grown(rows, *CHANGES.get(change, (0.0, 1)), n + BEFORE) for rows in lives(healthy, 8, n + YEAR, 1)]
        lists[change] = [np.array([v for row in rows if (v := row.indicators["friction_n"].value)]) for rows in made]
    print("other tests: years with an alarm at the usual limit; delays with a limit that gives our rate, its factor")
    for name, (test, usual) in OTHERS.items():
        series = {change: [test(y, n)[n:] for y in own] for change, own in lists.items()}
        greatest = np.array([each.max() for each in series["none"]])
        limit, found = float(np.quantile(greatest, 1.0 - plan.false_alarms_per_year)), []
        for change in wanted[1:]:
            over = [each[BEFORE:] > limit for each in series[change]]
            found.append(f"{change} {quantiles([np.argmax(each) + 1.0 if each.any() else np.nan for each in over])}")
        print(f"{name:23s} {np.mean(greatest > usual):.2f}; {limit / usual:.1f} times: {', '.join(found)}")


def main() -> None:
    """Simulate what is missing, then print every table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--scratch", type=Path, default=Path("build/monitoring"))
    parser.add_argument("--lives", type=int, default=11, help="per cylinder and disturbance; 0: those years alone")
    parser.add_argument("--years", type=int, default=100, help="in which every alarm is acknowledged; 0: none")
    parser.add_argument("--kept", action="store_true", help="use what an earlier run kept, and simulate nothing")
    parser.add_argument("--servo", action="store_true", help="healthy lives and growing friction on the servo rig")
    given = parser.parse_args()
    given.scratch.mkdir(parents=True, exist_ok=True)
    cases = [(fate, number) for number in range(HEALTHY) for fate in ("healthy", *DISTURBANCES)]
    cases += [(fate, number) for number in range(FAULTY) for fate in FAULTS]
    if given.servo:
        cases = [("servo", number) for number in range(FAULTY)]
    if given.kept:
        cases = [each for each in cases if (given.scratch / f"{each[0]}_{each[1]:02d}_{given.seed}.json").is_file()]
    with ProcessPoolExecutor(2) as pool:
        bank = dict(zip(cases, pool.map(partial(simulated, given.seed, given.scratch), cases), strict=True))
    healthy, plan = [Resampled(rows) for (fate, _), rows in bank.items() if fate in ("healthy", "servo")], MonitorPlan()
    print(f"{len(healthy)} healthy cylinders; {sum(map(len, bank.values()))} sessions simulated, seed {given.seed}")
    if given.servo:
        for baseline in (90, 30, 250):
            undisturbed(healthy, 4 * given.lives * HEALTHY // FAULTY, MonitorPlan(baseline_sessions=baseline))
        delays(healthy, plan)
        return
    if given.years:
        acknowledged(healthy, given.years, plan)
    if not given.lives:
        return
    false_alarms(bank, len(healthy), given.lives, plan)
    delays(healthy, plan)
    others(healthy, plan)
    fates(bank, plan)
    for baseline in (30, 250):
        false_alarms(bank, len(healthy), given.lives, MonitorPlan(baseline_sessions=baseline))


if __name__ == "__main__":
    main()
