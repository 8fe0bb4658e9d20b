"""The simulated test bench: hydraulics, true friction, hand lever, sensors, faults, and campaigns of recordings."""

from cylinder_friction.rig.campaign import TRUTH_COLUMNS, CampaignPlan, RigRecording, campaign
from cylinder_friction.rig.faults import FAULTS, with_fault
from cylinder_friction.rig.parameters import (
    PUMP_FLOWS_M3_S,
    THROTTLE_GAINS,
    FrictionParameters,
    HydraulicParameters,
    RigParameters,
    SensorParameters,
    default_rig,
)
from cylinder_friction.rig.programmes import programme
from cylinder_friction.rig.sensors import LOGGER_COLUMNS, measure
from cylinder_friction.rig.simulate import RigState, balanced_state, simulate

__all__ = [
    "FAULTS",
    "LOGGER_COLUMNS",
    "PUMP_FLOWS_M3_S",
    "THROTTLE_GAINS",
    "TRUTH_COLUMNS",
    "CampaignPlan",
    "FrictionParameters",
    "HydraulicParameters",
    "RigParameters",
    "RigRecording",
    "RigState",
    "SensorParameters",
    "balanced_state",
    "campaign",
    "default_rig",
    "measure",
    "programme",
    "simulate",
    "with_fault",
]
