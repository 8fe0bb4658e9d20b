"""The test bench for other packages: a rig, strokes of its lever, a simulated session and the logger's table.

These names are public; another package uses them to simulate fleets.
"""

from cylinder_friction.recordings.recording import RecordingMetadata
from cylinder_friction.rig.campaign import MAKEUP_GAIN, TRUTH_COLUMNS, RigRecording
from cylinder_friction.rig.duty_cycles import Row, lever_for_speed
from cylinder_friction.rig.external_load import ExternalLoad
from cylinder_friction.rig.lever import MOVE, TICK_S, DutyCycle, hand_remnant, ornstein_uhlenbeck
from cylinder_friction.rig.parameters import BAR_PA, DEFAULT_STEP_S, RigParameters, default_rig, refuse_unknown
from cylinder_friction.rig.sensors import DECIMALS, measure
from cylinder_friction.rig.simulate import balanced_state, simulate
from cylinder_friction.rig.variation import draw_rig

__all__ = [
    "BAR_PA",
    "DECIMALS",
    "DEFAULT_STEP_S",
    "MAKEUP_GAIN",
    "MOVE",
    "TICK_S",
    "TRUTH_COLUMNS",
    "DutyCycle",
    "ExternalLoad",
    "RecordingMetadata",
    "RigParameters",
    "RigRecording",
    "Row",
    "balanced_state",
    "default_rig",
    "draw_rig",
    "hand_remnant",
    "lever_for_speed",
    "measure",
    "ornstein_uhlenbeck",
    "refuse_unknown",
    "simulate",
]
