import numpy as np
import pandas as pd
import pytest

from cylinder_friction.rig.faults import FAULTS, with_fault
from cylinder_friction.rig.parameters import RigParameters
from cylinder_friction.rig.sensors import measure
from cylinder_friction.rig.simulate import balanced_state, simulate


def stroke(rig: RigParameters, level: float = 0.35, seconds: float = 4.0) -> pd.DataFrame:
    lever = np.full(round(seconds * 1000) + 2, level)
    return simulate(rig, lever, balanced_state(rig, 0.05, 8e5, 35.0), seconds)


def test_wear_lowers_friction_and_a_tight_seal_raises_it_and_breakaway(rigs: dict[str, RigParameters]) -> None:
    worn, healthy, tight = (
        stroke(with_fault(rigs["1"], each))["friction_n"] for each in ("wear", "none", "tight_seal")
    )
    assert worn.tail(1500).mean() < 0.85 * healthy.tail(1500).mean()
    assert tight.tail(1500).mean() > 1.2 * healthy.tail(1500).mean()
    assert tight.max() > 1.3 * healthy.max()


def test_air_makes_the_oil_soft(rigs: dict[str, RigParameters]) -> None:
    def rise_s(rig: RigParameters) -> float:
        trace = stroke(rig)
        pressure = trace["pressure_1_pa"]
        return float(trace["time_s"][pressure > 0.9 * pressure.tail(500).mean()].iloc[0])

    assert rise_s(with_fault(rigs["3"], "aeration")) > 1.2 * rise_s(rigs["3"])


def test_a_bent_rod_rubs_more_the_further_it_is_out(rigs: dict[str, RigParameters]) -> None:
    bent = stroke(with_fault(rigs["1"], "bent_rod"), 0.6)
    straight = stroke(rigs["1"], 0.6)
    extra = (bent["friction_n"] - straight["friction_n"]).to_numpy()
    near, far = np.searchsorted(straight["position_m"], [0.07, 0.18])
    assert extra[far] > 3.0 * abs(extra[near])


def test_sensor_drift_changes_what_is_seen_and_nothing_else(rigs: dict[str, RigParameters]) -> None:
    drifting = with_fault(rigs["1"], "sensor_drift")
    trace = stroke(rigs["1"])
    assert trace.equals(stroke(drifting))
    later = [
        measure(rig.sensors, trace, np.random.default_rng(0), 600.0)["P1 [bar]"].mean() for rig in (rigs["1"], drifting)
    ]
    assert later[1] - later[0] == pytest.approx(5.0, abs=0.1)


@pytest.mark.parametrize("fault", sorted(FAULTS))
def test_no_severity_is_no_fault(rigs: dict[str, RigParameters], fault: str) -> None:
    assert with_fault(rigs["1"], fault, 0.0) == rigs["1"]


def test_unknown_faults_and_negative_severities_are_refused(rigs: dict[str, RigParameters]) -> None:
    with pytest.raises(ValueError, match=r"record\.fault: got 'rust', but expected one of \['aeration', 'bent_rod'"):
        with_fault(rigs["1"], "rust")
    with pytest.raises(ValueError, match=r"severity: got -1\.0, but expected 0 \(healthy\) or more"):
        with_fault(rigs["1"], "wear", -1.0)
