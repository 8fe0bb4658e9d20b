"""Parameters of the stage ``ingest``: which files are read, and how they become recordings.

The rules are the dataclasses that ``recordings`` takes, which check their own numbers.
"""

from __future__ import annotations

from typing import Literal

from pydantic import field_validator, model_validator

from cylinder_friction.params.section import Section
from cylinder_friction.recordings.checks.limits import CheckRules, LoadMode
from cylinder_friction.recordings.checks.screening import ScreenRules
from cylinder_friction.recordings.formats.layout import CsvOptions
from cylinder_friction.recordings.mapping.calibration import ZeroRules
from cylinder_friction.recordings.mapping.channel_mapping import ChannelMapping, check_mapping
from cylinder_friction.recordings.path_names import compile_name_pattern
from cylinder_friction.recordings.timeline.timestamps import TimeRules


class IngestParams(Section):
    """Which folder is read and how its files become recordings."""

    source: str
    truth: str
    load: LoadMode
    oil_temperature: Literal["recorded", "input"]
    pattern: str
    name_pattern: str | None
    name_table: str | None
    format: Literal["auto", "csv", "matlab", "mdf", "tdms", "hdf5", "parquet", "excel"]
    csv: CsvOptions
    channels: dict[str, ChannelMapping]
    time: TimeRules
    screen: ScreenRules
    zero: ZeroRules
    checks: CheckRules

    @field_validator("channels")
    @classmethod
    def _channels_make_a_recording(cls, channels: dict[str, ChannelMapping]) -> dict[str, ChannelMapping]:
        check_mapping(channels)
        return channels

    @model_validator(mode="after")
    def _names_come_from_one_place(self) -> IngestParams:
        if (self.name_pattern is None) == (self.name_table is None):
            raise ValueError("name_pattern or name_table must be set, and the other null")
        if self.name_pattern is not None:
            compile_name_pattern(self.name_pattern)
        return self
