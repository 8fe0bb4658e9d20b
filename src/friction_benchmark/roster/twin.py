"""Taught by the simulated twin: true friction of many random rigs, then used on a rig that nobody has seen."""

from __future__ import annotations

from typing import TYPE_CHECKING

from friction_benchmark.models.learned_gain import GainArchitecture, GainPlan, LearnedGainEstimator
from friction_benchmark.roster.entry import OneOf, Range, RosterEntry, needs_raw_pressures

if TYPE_CHECKING:
    from collections.abc import Mapping

    from friction_benchmark.roster.entry import Making, Value

FULL_PRESENTATIONS = 3_000
"""Recordings that full training goes through, however many different ones there are."""
SPACE: Mapping[str, Range | OneOf] = {"nodes": OneOf((32, 48)), "learning_rate": Range(2e-3, 1e-2, logarithmic=True)}
FIRST: Mapping[str, Value] = {"nodes": 32, "learning_rate": 5e-3}
SOURCE = "after Revach et al. 2022 (KalmanNet)"


def make_learned_gain(making: Making) -> LearnedGainEstimator:
    """Return the filter of learned gain; effort cuts how often it goes through its recordings."""
    presentations = max(1, round(FULL_PRESENTATIONS * making.effort))
    return LearnedGainEstimator(
        making.cylinder,
        GainArchitecture(int(making.choice["nodes"])),
        GainPlan(presentations, float(making.choice["learning_rate"])),
        making.inputs,
        making.seed,
    )


ENTRIES = (
    RosterEntry(
        name="twin_hybrid",
        title="Hybrid taught by the twin",
        family="modern",
        source=f"{SOURCE}; own teaching",
        make=make_learned_gain,
        space=SPACE,
        first=FIRST,
        can=needs_raw_pressures,
        teacher="twin",
        chosen=(
            "A filter of the force balance whose gain and offset an LSTM of one layer sets at every sample; where "
            "sensors are far off, it also sees the mean force balance of the strokes so far. Taught by true "
            "friction of random rigs, never by a recording of the rig that it is used on."
        ),
    ),
    RosterEntry(
        name="learned_gain",
        title="Learned gain, taught by labels",
        family="modern",
        source=SOURCE,
        make=make_learned_gain,
        space=SPACE,
        first=FIRST,
        can=needs_raw_pressures,
        chosen="The same filter and network as the hybrid taught by the twin, but taught by the rig's own labels.",
    ),
)
