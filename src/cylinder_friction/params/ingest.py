"""Parameters of the stage ``ingest``: which files are read, and how they become recordings."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, field_validator

from cylinder_friction.params.section import Positive, Section
from cylinder_friction.recordings.mapping import ChannelMapping, check_mapping, compile_name_pattern


class ChannelParams(Section):
    """Where one column comes from: the logger's channel, its unit, and -1 where the sensor is mounted backwards."""

    channel: str
    unit: str
    sign: Literal[1, -1] = 1


class CsvParams(Section):
    """How the lines of a CSV file are cut into numbers."""

    delimiter: Annotated[str, Field(min_length=1, max_length=1)]
    decimal: Literal[".", ","]
    encoding: str


class IngestParams(Section):
    """Which folder is read and how its files become recordings."""

    source: str
    truth: str
    format: Literal["csv"]
    csv: CsvParams
    pattern: str
    name_pattern: str
    channels: dict[str, ChannelParams]
    minimum_duration_s: Positive

    @field_validator("channels")
    @classmethod
    def _channels_make_a_recording(cls, channels: dict[str, ChannelParams]) -> dict[str, ChannelParams]:
        check_mapping({column: ChannelMapping(**channel.model_dump()) for column, channel in channels.items()})
        return channels

    @field_validator("name_pattern")
    @classmethod
    def _name_pattern_tells_test_and_session(cls, pattern: str) -> str:
        compile_name_pattern(pattern)
        return pattern
