import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.recordings.checks.limits import CheckLimits, Finding, LoadMode, StatedLoad
from cylinder_friction.recordings.checks.plausibility import check_friction
from cylinder_friction.recordings.recording import Recording
from logger_files import columns_of

Change = Callable[[pd.DataFrame], pd.DataFrame]

STROKE_M = 0.25


def swapped(table: pd.DataFrame) -> pd.DataFrame:
    return table.assign(pressure_1_pa=table["pressure_2_pa"], pressure_2_pa=table["pressure_1_pa"])


def inverted(table: pd.DataFrame) -> pd.DataFrame:
    return table.assign(position_m=STROKE_M - table["position_m"])


def scaled(factor: float) -> Change:
    return lambda table: table.assign(**table[["pressure_1_pa", "pressure_2_pa"]] * factor)


def checked(table: pd.DataFrame, cylinder: Cylinder, load: LoadMode = "none") -> list[Finding]:
    return check_friction(columns_of(table), 0.005, CheckLimits(cylinder, load))


def outcomes(findings: list[Finding]) -> dict[str, str]:
    return {finding.check: finding.outcome for finding in findings}


NOTED_SIZE = {"friction_size": "noted"}
REFUSED = {"direction": "refused"}


@pytest.mark.parametrize("load", ["none", "position"])
@pytest.mark.parametrize(
    ("change", "expected", "text"),
    [
        (lambda table: table, {}, ""),
        (swapped, REFUSED, r"^the pressures are swapped: as they stand, .* N retracting .* exchange the channels"),
        (inverted, REFUSED, r"^friction would drive the piston: .*position_m is inverted, or both pressures are: .*-1"),
        (lambda table: swapped(inverted(table)), REFUSED, "^the pressures are swapped and position_m is inverted: "),
        (scaled(100.0), {"friction_size": "refused"}, r"expected less than 100; .*kPa read as bar"),
        (scaled(10.0), NOTED_SIZE, r"usual are 0.2 to 10; .* \(bar read as MPa\?\)"),
        (scaled(0.1), NOTED_SIZE, r"\(MPa read as bar\?\)"),
    ],
)
def test_two_pressures_show_what_is_wrong(
    labelled_recordings: list[Recording],
    cylinder: Cylinder,
    change: Change,
    expected: dict[str, str],
    text: str,
    load: Any,
) -> None:
    for table in (each.table for each in labelled_recordings):
        findings = checked(change(table), cylinder, load)
        assert outcomes(findings) == expected
        assert not findings or any(re.search(text, finding.text) for finding in findings)


@pytest.mark.parametrize("column", ["pressure_1_pa", "pressure_2_pa"])
@pytest.mark.parametrize("offset_pa", [-1.25e5, 1.25e5])
def test_a_sensors_zero_is_never_taken_for_a_swap(
    labelled_recordings: list[Recording], cylinder: Cylinder, column: str, offset_pa: float
) -> None:
    for table in (each.table for each in labelled_recordings):
        wrong = table.assign(**{column: table[column] + offset_pa})
        assert outcomes(checked(wrong, cylinder)).get("direction") in (None, "noted")
        assert outcomes(checked(swapped(wrong), cylinder)) == REFUSED
        assert outcomes(checked(inverted(wrong), cylinder)) == REFUSED


def pushed(friction_n: float = 300.0, load_n: float = 0.0, seconds: float = 20.0) -> pd.DataFrame:
    """A sine of 50 mm against Coulomb friction and a load cell's reading, measured as a force."""
    time_s = 0.005 * np.arange(round(seconds / 0.005))
    load = load_n * np.cos(1.7 * time_s)
    noise = np.random.default_rng(0).normal(0.0, 5.0, len(time_s))
    columns = {"position_m": 0.12 + 0.05 * np.sin(time_s), "load_force_n": load}
    return pd.DataFrame(columns | {"drive_force_n": friction_n * np.sign(np.cos(time_s)) + load + noise})


SECONDS = 0.005 * np.arange(4000)
ONE_WAY = np.where(SECONDS < 10.0, 0.03 + 0.008 * SECONDS, 0.24 - 0.008 * (SECONDS - 10.0))
LOADED = pushed(load_n=2000.0)
PULLED = pushed().assign(drive_force_n=lambda table: table["drive_force_n"] + 2000.0)
WEIGHED = PULLED.assign(load_force_n=2000.0)
INVERTED = "^the mapped load_force_n is inverted: as it stands, the force against the motion is"
UNKNOWN = "one of them drives the motion, so there is"


@pytest.mark.parametrize(
    ("table", "load", "outcome", "text"),
    [
        (pushed(), "none", "ok", ""),
        (pushed(-300.0), "none", "refused", "change the sign of position_m or of drive_force_n"),
        (LOADED, "measured", "ok", ""),
        (WEIGHED, "measured", "ok", ""),
        (LOADED.drop(columns="load_force_n"), "measured", "noted", "is not recorded, though the load is to be measure"),
        (LOADED.assign(load_force_n=-LOADED["load_force_n"]), "measured", "refused", INVERTED),
        (WEIGHED.assign(load_force_n=-2000.0), "measured", "refused", INVERTED),
        (PULLED, "none", "noted", UNKNOWN + r" a load of about 2e\+03 N.*; state the load, or zero the sensors$"),
        (PULLED, "measured", "noted", UNKNOWN + r" another load of about 2e\+03 N.*; check unit and zero of load"),
        (pushed().iloc[:5], "none", "noted", "in 0 rows only, expected 20 each"),
        (pushed().assign(position_m=ONE_WAY), "none", "noted", "hardly pass the same positions"),
        *((pushed().assign(position_m=x_m), "none", "noted", "in 0 rows only") for x_m in (0.1, 0.1 + 0.01 * SECONDS)),
        (pushed(0.0), "none", "noted", "cannot be distinguished from zero"),
    ],
)
def test_a_force_shows_its_direction_or_why_not(
    cylinder: Cylinder, table: pd.DataFrame, load: LoadMode, outcome: str, text: str
) -> None:
    found = checked(table, cylinder, load)
    assert [each.outcome for each in found] == ([] if outcome == "ok" else [outcome])
    assert all(re.search(text, each.text) for each in found)


def test_a_stated_load_is_named_as_such(cylinder: Cylinder) -> None:
    limits = CheckLimits(cylinder, "measured", stated_load=StatedLoad(-2000.0))
    ((turned,), (other,)) = (
        check_friction(columns_of(WEIGHED.assign(load_force_n=load_n)), 0.005, limits) for load_n in (-2000.0, 0.0)
    )
    assert turned.text.startswith("the stated load of -2000 N (--load, or the mapping's) is inverted: as it stands")
    assert other.text.endswith("; check the stated load, or zero the sensors")


@pytest.mark.parametrize("sign", [1.0, -0.97, 0.8])
def test_a_load_computed_from_the_pressures_is_refused(
    labelled_recordings: list[Recording], cylinder: Cylinder, sign: float
) -> None:
    table = labelled_recordings[0].table
    drive_n = table["pressure_1_pa"] * cylinder.piston_area_m2 - table["pressure_2_pa"] * cylinder.annulus_area_m2
    (found,) = checked(table.assign(load_force_n=sign * drive_n), cylinder, "measured")
    assert (found.outcome, "friction: it is a force computed from the pressures" in found.text) == ("refused", True)
