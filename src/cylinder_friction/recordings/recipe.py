"""How a logger's file becomes recordings: everything that a configuration says about it, in one place."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from cylinder_friction.recordings.calibration import ZeroRules
from cylinder_friction.recordings.formats.options import CsvOptions
from cylinder_friction.recordings.screening import ScreenRules
from cylinder_friction.recordings.time_rules import TimeRules

if TYPE_CHECKING:
    from collections.abc import Mapping

    from cylinder_friction.recordings.check_limits import CheckLimits
    from cylinder_friction.recordings.mapping import ChannelMapping
    from cylinder_friction.recordings.names import NameRules


@dataclass(frozen=True)
class Recipe:
    """How a logger's file becomes recordings.

    Attributes:
        names: What a file's path, or a table beside the files, says about who and when.
        channels: Column to the logger's channel.
        cylinder: Name of the cylinder whose recordings they are.
        limits: What a recording must be.
        file_format: One of ``formats.FORMATS``, or ``auto``, which looks into the file.
        csv: How text files are cut into numbers.
        screen: How single bad samples are found.
        time: How stamps become one constant rate.
        zero: How the pressure sensors' zeros are found.
    """

    names: NameRules
    channels: Mapping[str, ChannelMapping]
    cylinder: str
    limits: CheckLimits
    file_format: str = "auto"
    csv: CsvOptions = field(default_factory=CsvOptions)
    screen: ScreenRules = field(default_factory=ScreenRules)
    time: TimeRules = field(default_factory=TimeRules)
    zero: ZeroRules = field(default_factory=ZeroRules)
