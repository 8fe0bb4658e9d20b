"""A rig at each throttle setting, and one recording's trace of it."""

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.rig.duty_cycles import duty_cycle
from cylinder_friction.rig.parameters import THROTTLE_GAINS, RigParameters, default_rig
from cylinder_friction.rig.simulate import balanced_state, simulate


@pytest.fixture(scope="session")
def rigs(cylinder: Cylinder) -> dict[str, RigParameters]:
    return {condition: default_rig(cylinder).with_throttle(gain) for condition, gain in THROTTLE_GAINS.items()}


@pytest.fixture(scope="session")
def traces(rigs: dict[str, RigParameters]) -> dict[str, pd.DataFrame]:
    """Two minutes by hand at each setting, in one table each."""
    made = {}
    for condition, rig in rigs.items():
        generator = np.random.default_rng([7, int(condition)])
        hand = duty_cycle(rig, generator, 120.0)
        made[condition] = simulate(rig, hand, balanced_state(rig, 0.1, 8e5, 35.0), 120.0)
    return made
