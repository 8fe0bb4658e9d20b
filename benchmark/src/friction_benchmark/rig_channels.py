"""What the channels of the rig's logger mean: the mapping that ingest is given for the rig's files (conf/ingest)."""

from cylinder_friction.recordings.mapping.channel_mapping import ChannelMapping, SensorScale
from cylinder_friction.rig.sensors import LOAD_COLUMN, LOGGER_COLUMNS

NAME_PATTERN = r"(?P<session>condition(?P<condition>[^_/]+)_session[^_/]+)_[^/]*\.csv$"
"""What is read from a file's name."""

_TRANSMITTER = SensorScale((0.0, 250.0), "bar", bits=12, accuracy_percent=0.05, zero_uncertainty=0.03)
_PT100 = SensorScale((0.0, 100.0), "degC", bits=12, accuracy_percent=0.5)
_LOAD_CELL = SensorScale((-5000.0, 5000.0), "N", bits=12, accuracy_percent=0.1)


def logger_channels(*, load: bool) -> dict[str, ChannelMapping]:
    """Return where each column of a recording comes from; ``load``: whether the rig has its load cell."""
    time, first, second, position, oil = LOGGER_COLUMNS
    channels = {
        "time_s": ChannelMapping(time, "s"),
        "pressure_1_pa": ChannelMapping(first, "bar", sensor=_TRANSMITTER),
        "pressure_2_pa": ChannelMapping(second, "bar", sensor=_TRANSMITTER),
        "position_m": ChannelMapping(position, "mm"),
        "oil_temperature_c": ChannelMapping(oil, "degC", sensor=_PT100),
    }
    return channels | {"load_force_n": ChannelMapping(LOAD_COLUMN, "N", sensor=_LOAD_CELL)} if load else channels
