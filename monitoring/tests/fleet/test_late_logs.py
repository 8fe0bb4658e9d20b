"""Clocks that were set back, late logs, copies and exchanged loggers: no alarm is lost, none is invented.

Each life is 40 healthy logs, which a first night assesses, and 12 more that come later. ``make lives``
lives through all cases with 16 and 40 lives.
"""

import os
import shutil
from collections.abc import Sequence
from datetime import date, timedelta
from pathlib import Path

import numpy as np
import pytest
import yaml

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.recordings.recording import Recording
from cylinder_friction_monitoring.fleet.nightly import FleetHealth, monitor_fleet
from cylinder_friction_monitoring.fleet.plan import Fleet
from fleet_samples import DIMENSIONS, NOW, write_fleet, write_session
from made_recordings import made_recording
from packed_pages import unpacked_pane

CYLINDER = Cylinder(name="a", **DIMENSIONS)
FIRST_DAY = date(2026, 2, 1)  # So that summer time begins within a life
HEALTHY, LATER = 40, 12
SCATTER, WEAR = 0.02, 0.4  # Without an oil temperature, less than 25 % is no alarm
SET_BACK_D = (1, 30, 365, 9497)  # The last: 26 years
START = {
    "zone": "Europe/Berlin",
    "pattern": r"(?P<year>\d{4})-(?P<month>\d\d)-(?P<day>\d\d)T(?P<hour>\d\d)",
}
FEW = [(0, 9497, True, False), (1, 30, False, True)]
MANY = [
    (life, days, at_once, names_right)
    for life in range(16)
    for days in SET_BACK_D
    for at_once in (True, False)
    for names_right in (True, False)
]
EVENTS = ("late", "accepted", "copies", "half", "summer time", "other logger")


def log_of(life: int, number: int, wear: float) -> Recording:
    """Make a short log whose friction scatters from session to session, and grows by ``wear``."""
    made = made_recording(CYLINDER, seed=1000 * life + number, seconds=8.0)
    scatter = SCATTER * float(np.random.default_rng([life, number]).normal())
    more_n = ((1.0 + scatter) * (1.0 + wear) - 1.0) * made.table["friction_n"]
    pressure_pa = made.table["pressure_1_pa"] + more_n / CYLINDER.piston_area_m2
    return Recording(made.metadata, made.table.assign(pressure_1_pa=pressure_pa))


def name_of(number: int, set_back_d: int = 0, hour: int = 6, counter: int | None = None) -> str:
    """Name a log by a counter and the date of the logger's clock."""
    day = FIRST_DAY + timedelta(days=number - set_back_d)
    return f"{number if counter is None else counter:04d}_{day:%Y-%m-%d}T{hour:02d}.csv"


class Life:
    """A cylinder after a first night with healthy logs."""

    def __init__(self, folder: Path, life: int, wear: float, **own: object) -> None:
        self.folder, self.life, self.wear = folder, life, wear
        self.logs = folder / "logs/a"
        self.logs.mkdir(parents=True)
        self.fleet = self.stated(**own)
        for number in range(HEALTHY):
            self.add(name_of(number), number)
        assert self.night().status == 0

    def stated(self, **own: object) -> Fleet:
        """State something in the fleet file."""
        fleet = write_fleet(self.folder, "a", "b", own={"a": {"baseline_sessions": 30, **own}})
        channels = yaml.safe_load((self.folder / "channels.yaml").read_text())
        (self.folder / "channels.yaml").write_text(yaml.safe_dump(channels | {"start": START}))
        self.fleet = fleet
        return fleet

    def add(self, name: str, number: int) -> Path:
        worn = self.wear if number >= HEALTHY else 0.0
        return write_session(self.logs / name, log_of(self.life, number, worn))

    def night(self) -> FleetHealth:
        return monitor_fleet([self.folder / "logs"], self.fleet, self.folder / "health", NOW)

    @property
    def answer(self) -> str:
        return self.line(self.night())

    @staticmethod
    def line(health: FleetHealth) -> str:
        return next(each.answer for each in health.lines if each.cylinder == "a")


def named_everywhere(folder: Path, health: FleetHealth, names: Sequence[str]) -> bool:
    """Check that result, page, pane and exit status name the logs, and nothing else."""
    sessions = {f"a-{Path(name).stem}" for name in names}
    found = {each.file.removeprefix("a: ") for each in health.refused}
    page = (folder / "health/health.html").read_text()
    pane = unpacked_pane(folder / "health/panes/a.js").replace("<wbr>", "")
    dates = [Path(name).stem.partition("_")[2][:10] for name in names]
    shown = all(f"begins at {day}" in page and f"begins at {day}" in pane for day in dates)
    line = next(each for each in health.lines if each.cylinder == "a")
    looked = not names or str(len(names)) in line.look
    status = (1, 3) if names else (0, 3)  # 3: a new alarm
    return found == sessions and shown and looked and health.status in status


@pytest.mark.parametrize(
    ("life", "days", "at_once", "names_right"),
    [*FEW, *(pytest.param(*each, marks=pytest.mark.lives) for each in MANY)],
)
def test_a_clock_that_was_set_back_hides_no_alarm(
    tmp_path: Path, life: int, days: int, at_once: bool, names_right: bool
) -> None:
    worn = Life(tmp_path, life, WEAR)
    shuffled = np.random.default_rng(life).permutation(np.arange(100, 100 + LATER))
    names, unassessed = list[str](), list[str]()
    newest = FIRST_DAY + timedelta(days=HEALTHY - 1)
    for place, number in enumerate(range(HEALTHY, HEALTHY + LATER)):
        names.append(name_of(number, days, counter=None if names_right else int(shuffled[place])))
        worn.add(names[-1], number)
        day = FIRST_DAY + timedelta(days=number - days)
        if (newest - day).days > 3:
            unassessed.append(names[-1])
        if not at_once:
            newest = max(newest, day)
            health = worn.night()
            assert named_everywhere(tmp_path, health, unassessed)
    for _ in range(2):  # on that night and on the following one
        health = worn.night()
        assert named_everywhere(tmp_path, health, unassessed)
    assert worn.line(health) == ("fine" if unassessed else "alarm")
    worn.stated(starts={f"a-{Path(each).stem}": f"+{days} d" for each in names})
    assert (worn.answer, worn.night().refused) == ("alarm", ())
    if unassessed:  # the correction is taken out again
        worn.stated()
        assert named_everywhere(tmp_path, worn.night(), names)


def test_an_alarm_stays_and_one_pattern_corrects_the_clock(tmp_path: Path) -> None:
    worn = Life(tmp_path, 1, WEAR)
    half = HEALTHY + LATER // 2
    for number in range(HEALTHY, half):
        worn.add(name_of(number), number)
    assert worn.answer == "alarm"
    names = [name_of(number, 365) for number in range(half, HEALTHY + LATER)]
    for number, name in enumerate(names, start=half):
        worn.add(name, number)
    health = worn.night()
    assert worn.line(health) == "alarm"
    assert named_everywhere(tmp_path, health, names)
    for damaged in ("sessions/a.parquet", "cylinders/a.json"):
        (tmp_path / "health" / damaged).write_bytes(b"damaged")
        health = worn.night()
        assert health.refused[0].file == damaged
        assert worn.line(health) == "alarm"
        assert named_everywhere(tmp_path, worn.night(), names)
    worn.stated(starts={"a-00??_2025-*": "+365 d"})
    health = worn.night()
    assert (health.refused, worn.line(health)) == ((), "alarm")
    assert health.lines[0].sessions == HEALTHY + LATER


def in_order(folder: Path, life: int, wear: float) -> str:
    """Return the answer if all logs come in order."""
    own = Life(folder, life, wear)
    for number in range(HEALTHY, HEALTHY + LATER):
        own.add(name_of(number), number)
    return own.answer


def after_event(folder: Path, life: int, wear: float, event: str) -> str:
    """Live through one event with a night after every fourth log, and return the last answer."""
    own = Life(folder, life, wear, **({"late": "accept"} if event == "accepted" else {}))
    numbers = list(range(HEALTHY, HEALTHY + LATER))
    for place, number in enumerate(numbers):
        name = name_of(number)
        if event == "late":  # two logs of each three come in the wrong order
            number = numbers[place - place % 3 : place - place % 3 + 3][-1 - place % 3]
            name = name_of(number)
        elif event == "accepted":  # the second half comes first
            number = numbers[(place + LATER // 2) % LATER]
            name = name_of(number)
        elif event == "summer time":
            name = name_of(number, hour=7 if place % 2 else 6)
        elif event == "other logger":
            name = f"new logger {name_of(number, counter=9000 - number)}"
        path = own.add(name, number)
        if place % 4 < 3:
            continue
        whole, copy = path.read_bytes(), own.logs / f"copy of {name}"
        if event == "half":
            path.write_bytes(whole[: len(whole) * 2 // 3].rpartition(b"\n")[0] + b"\n")
            os.utime(path, (1e9, 1e9))
        if event == "copies":
            shutil.copy2(path, copy)
        health = own.night()
        assert event == "copies" or health.status in (0, 3), health.refused
        copy.unlink(missing_ok=True)
        path.write_bytes(whole)
        os.utime(path, (1e9, 1e9))
    health = own.night()
    assert health.refused == ()
    return own.line(health)


@pytest.mark.parametrize(
    ("life", "event", "wear"),
    [
        *((life, event, WEAR if life % 2 else 0.0) for life, event in enumerate(EVENTS)),
        *(
            pytest.param(life, event, wear, marks=pytest.mark.lives)
            for life in range(20, 40)
            for event in EVENTS
            for wear in (0.0, WEAR)
        ),
    ],
)
def test_late_logs_within_the_days_copies_halves_and_other_loggers_are_as_in_order(
    tmp_path: Path, life: int, event: str, wear: float
) -> None:
    ordered = in_order(tmp_path / "ordered", life, wear)
    assert (ordered == "alarm") == bool(wear)
    assert after_event(tmp_path / "event", life, wear, event) == ordered


def test_a_log_that_came_late_is_taken_by_one_line_and_then_stays(tmp_path: Path) -> None:
    own = Life(tmp_path, 3, 0.0)
    name = name_of(HEALTHY, 30, hour=8)
    own.add(name, HEALTHY)
    assert named_everywhere(tmp_path, own.night(), [name])
    own.stated(late=31)
    assert own.night().refused == ()
    own.stated(late="accept")
    assert own.night().refused == ()
    own.stated()
    health = own.night()
    assert (health.refused, health.lines[-1].sessions) == ((), HEALTHY + 1)
