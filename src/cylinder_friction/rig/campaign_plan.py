"""The plan of a campaign, which is the section ``record`` of ``params.yaml``."""

import math
from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from cylinder_friction.rig.parameters import DEFAULT_STEP_S, THROTTLE_GAINS


def _whole_milliseconds(seconds: float) -> float:
    if not math.isclose(seconds, round(seconds, 3), rel_tol=1e-9) or round(seconds, 3) == 0.0:
        raise ValueError("must be a whole number of milliseconds, such as 0.005")
    return seconds


def _divides_a_millisecond(seconds: float) -> float:
    if not math.isclose(round(1e-3 / seconds) * seconds, 1e-3, rel_tol=1e-9):
        raise ValueError("must divide one millisecond without remainder, such as 5.0e-5")
    return seconds


_NotNegative = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
_Milliseconds = Annotated[float, Field(gt=0.0, allow_inf_nan=False), AfterValidator(_whole_milliseconds)]
"""A whole number of milliseconds [s], since the hand lever and the trace have steps of 1 ms."""


@dataclass(frozen=True)
class CampaignPlan:
    """Amount and conditions of the recordings: the section ``record`` of ``params.yaml``."""

    # Seed of all random numbers
    seed: Annotated[int, Field(ge=0, lt=2**31)] = 0
    # Sessions in each of the four conditions, each with its temperature, offsets and drift
    sessions_per_condition: Annotated[int, Field(ge=0)] = 6
    recordings_per_session: Annotated[int, Field(ge=1)] = 2  # Recordings per session; two contain all set exercises
    duration_s: _Milliseconds = 60.0  # Duration of a recording [s]
    sample_time_s: _Milliseconds = 0.005  # Sample time of the logger [s]
    # Step of the integration [s]
    time_step_s: Annotated[float, Field(gt=0.0, le=2e-4), AfterValidator(_divides_a_millisecond)] = DEFAULT_STEP_S
    supply: Literal["didactic", "industrial"] = "industrial"
    zeroed: bool = True  # Whether the pressure transmitters were zeroed before each session
    residual_offset_bar: _NotNegative = 0.05  # Largest offset that zeroing leaves [bar]
    # How the transmitters' zeros change: drawn anew in each session, the same in all, wandering from session to session
    # about 0, or half of each
    zeros: Literal["drawn anew", "kept", "drifting", "kept and drifting"] = "drawn anew"
    # Standard deviation, from session to session, of the ratio of friction retracting to friction extending
    asymmetry_sd: _NotNegative = 0.0
    fault: Literal["none", "wear", "tight_seal", "aeration", "sensor_drift", "bent_rod"] = "none"
    # ``"varied"``: forces on the rod that change within a recording, and a load cell. ``"boom"``: a crane without a
    # load cell, whose load depends on position alone
    external_load: Literal["none", "varied", "boom"] = "none"
    load_delay_s: _NotNegative = 0.0  # Delay of the load cell, whole milliseconds [s]
    weight_n: _NotNegative = 0.0  # Weight that an upright cylinder lifts [N]; its mass belongs to the moving mass
    # With transmitters at the valve: loss between valve and piston side at 0.1 m/s [bar], and its laminar share, 0 to 1
    line_loss_bar: _NotNegative = 0.0
    line_laminar_share: Annotated[float, Field(ge=0.0, le=1.0)] = 0.2
    pressure_lag_s: _NotNegative = 0.0  # First-order lag of the pressure transmitters [s]
    # Standard deviation, from condition to condition, of the ratio of friction retracting to friction extending
    asymmetry_by_condition: _NotNegative = 0.0
    # Growth of dry friction per e-fold of rest, which a travel of 2 mm takes back
    ageing: _NotNegative = 0.0
    position_step_m: _NotNegative = 0.0  # Step of a digital position sensor; 0 for the potentiometer [m]
    # ``"default"``, one rig within its tolerances, or ``"wide"``, any rig of this size
    specimen: Literal["default", "wide"] = "default"
    # What a recording begins with: ``"work"``; ``"rest"`` of the piston after a stroke that nobody logged, or at an
    # ``"end_stop"`` that the stroke reached
    start: Literal["work", "rest", "end_stop"] = "work"
    # Whether transmitters are in the ports, where they do not see the pressure that cushions hold in the chambers
    cushions_unseen: bool = False
    # Largest time by which the logger takes a sample too early or late, as a share of half its sample time
    jitter: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0

    @property
    def recordings(self) -> int:
        """Number of recordings."""
        return len(THROTTLE_GAINS) * self.sessions_per_condition * self.recordings_per_session
