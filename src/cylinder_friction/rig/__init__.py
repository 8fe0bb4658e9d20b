"""The simulated test bench: hydraulics, true friction, hand lever, sensors, faults, and campaigns of recordings."""

from cylinder_friction.rig.campaign import TRUTH_COLUMNS, CampaignPlan, RigRecording, campaign
from cylinder_friction.rig.channels import NAME_PATTERN, logger_channels
from cylinder_friction.rig.external_load import ExternalLoad, varied_load
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
from cylinder_friction.rig.sensors import LOAD_COLUMN, LOGGER_COLUMNS, as_written, measure
from cylinder_friction.rig.simulate import TRACE_COLUMNS, RigState, balanced_state, simulate
from cylinder_friction.rig.wide import draw_wide_rig

__all__ = [
    "FAULTS",
    "LOAD_COLUMN",
    "LOGGER_COLUMNS",
    "NAME_PATTERN",
    "PUMP_FLOWS_M3_S",
    "THROTTLE_GAINS",
    "TRACE_COLUMNS",
    "TRUTH_COLUMNS",
    "CampaignPlan",
    "ExternalLoad",
    "FrictionParameters",
    "HydraulicParameters",
    "RigParameters",
    "RigRecording",
    "RigState",
    "SensorParameters",
    "as_written",
    "balanced_state",
    "campaign",
    "default_rig",
    "draw_wide_rig",
    "logger_channels",
    "measure",
    "programme",
    "simulate",
    "varied_load",
    "with_fault",
]
