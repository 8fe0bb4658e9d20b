"""What the simulated twin teaches: recordings of many rigs drawn at random, with their true friction as the target.

No rig of another campaign of the benchmark is among them: their seeds begin far beyond the others'. Friction,
hydraulics and sensors of each rig come from their whole ranges, and so do the sensors' offsets and gains of each
session, so that what is learnt holds for a rig that nobody has seen.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

from cylinder_friction.rig.campaign import CampaignPlan
from friction_benchmark.campaigns import LabelledRecording, labelled_campaign

if TYPE_CHECKING:
    from collections.abc import Iterator

    from cylinder_friction.cylinder import Cylinder

TWIN_SEEDS = 1_000_000
"""Seeds of the twin's rigs begin here, so that no rig that is estimated is a rig that taught."""
MOST_RIGS = 1_000


@dataclass(frozen=True)
class TwinPlan:
    """How much the twin teaches.

    Attributes:
        seed: Of all rigs; other seeds draw other rigs.
        rigs: How many; each with one session in each of the four tests, two recordings a session.
        duration_s: Of a recording [s].
        external_load: ``"none"``, or ``"varied"``: forces on the rod that change within a recording.

    Raises:
        ValueError: The number of rigs is not in 1 to ``MOST_RIGS``, or the seed is negative.
    """

    seed: int = 0
    rigs: int = 32
    duration_s: float = 30.0
    external_load: Literal["none", "varied"] = "none"

    def __post_init__(self) -> None:
        if not 1 <= self.rigs <= MOST_RIGS:
            raise ValueError(f"rigs must be 1 to {MOST_RIGS}, but got {self.rigs!r}")
        if self.seed < 0:
            raise ValueError(f"seed must be at least 0, but got {self.seed!r}")


def teaching_recordings(plan: TwinPlan, cylinder: Cylinder) -> tuple[LabelledRecording, ...]:
    """Return the twin's recordings, in the order of their names; ``friction_n`` is true friction, not the label.

    Which rows are usable is what the label says: where the piston stands against an end stop, pressures tell nothing.
    Equal plans give equal bits, and a plan of more rigs begins with those of fewer.
    """
    return tuple(recording for rig in range(plan.rigs) for recording in _lessons_of(plan, rig, cylinder))


def _lessons_of(plan: TwinPlan, rig: int, cylinder: Cylinder) -> Iterator[LabelledRecording]:
    campaign = CampaignPlan(
        seed=TWIN_SEEDS + MOST_RIGS * plan.seed + rig,
        sessions_per_condition=1,
        recordings_per_session=2,
        duration_s=plan.duration_s,
        external_load=plan.external_load,
        specimen="wide",
    )
    for labelled in labelled_campaign(campaign, cylinder):
        metadata = labelled.recording.metadata
        named = replace(metadata, name=f"rig{rig:03d}_{metadata.name}", session=f"rig{rig:03d}_{metadata.session}")
        taught = replace(labelled.recording, metadata=named).with_columns(friction_n=labelled.true_friction_n)
        yield replace(labelled, recording=taught)
