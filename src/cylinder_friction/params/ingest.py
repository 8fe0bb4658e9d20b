"""Parameters of the stage ``ingest``: which files are read, and how they become recordings."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, field_validator, model_validator

from cylinder_friction.params.section import Fraction, NotNegative, Positive, Section
from cylinder_friction.recordings.formats.options import CsvOptions
from cylinder_friction.recordings.mapping.calibration import ZeroRules
from cylinder_friction.recordings.mapping.channel_mapping import ChannelMapping, check_mapping
from cylinder_friction.recordings.path_names import compile_name_pattern

Pair = Annotated[tuple[float, float], Field(strict=False)]


class SensorParams(Section):
    """The sensor behind a channel; see ``recordings.SensorScale``."""

    range: Pair
    unit: str
    signal: Pair | None = None
    bits: int | None = None
    accuracy_percent: NotNegative | None = None
    zero_uncertainty: NotNegative | None = None


class ChannelParams(Section):
    """Where one column comes from; see ``recordings.ChannelMapping``."""

    channel: str = ""
    unit: str = ""
    sign: Literal[1, -1] = 1
    table: str = ""
    time: str = ""
    reference: Literal["gauge", "absolute"] = "gauge"
    sensor: SensorParams | None = None
    offset: float = 0.0
    rate_hz: Positive | None = None


class CsvParams(Section):
    """How text files are cut into numbers; ``auto`` looks into each file."""

    delimiter: str
    decimal: Literal["auto", ".", ","]
    encoding: str
    header: Literal["auto", "none", "names", "names_units"]

    @model_validator(mode="after")
    def _can_be_read(self) -> CsvParams:
        CsvOptions(**self.model_dump())
        return self


class TimeParams(Section):
    """How stamps become one constant rate; see ``recordings.TimeRules``."""

    rate_hz: Positive | None
    longest_bridge_samples: Annotated[int, Field(ge=0)]
    jitter_share: Annotated[float, Field(ge=0.0, le=0.25)]
    damaged_share: Annotated[float, Field(ge=0.0, le=0.5)]
    shortest_piece_samples: Annotated[int, Field(ge=3)]


class ScreenParams(Section):
    """When a single sample is bad; see ``recordings.ScreenRules``."""

    overrange: NotNegative
    most_bad: Fraction
    few_rows: Annotated[int, Field(ge=0)]
    longest_bad: Annotated[int, Field(ge=0)]
    spike_noise: Positive
    spike_range: Positive
    spike_steps: Positive


class ZeroParams(Section):
    """How the pressure sensors' zeros are found; see ``recordings.ZeroRules``."""

    method: Literal["none", "window", "found"]
    window_s: Pair | None
    band_pa: Positive
    steady_pa: Positive
    still_m: Positive
    minimum_s: Positive
    accuracy_factor: Positive

    @model_validator(mode="after")
    def _window_goes_with_its_method(self) -> ZeroParams:
        ZeroRules(**self.model_dump())
        return self


class ChecksParams(Section):
    """What a recording must be; see ``recordings.CheckLimits``."""

    minimum_duration_s: Positive
    minimum_rate_hz: Positive
    lowest_pressure_pa: float
    highest_pressure_pa: Positive
    least_pressure_span_pa: NotNegative
    least_peak_pressure_pa: NotNegative
    least_force_span_n: NotNegative
    position_slack: NotNegative
    least_travel: Fraction
    stuck_travel: Fraction


class IngestParams(Section):
    """Which folder is read and how its files become recordings."""

    source: str
    truth: str
    load: Literal["none", "measured", "position"]
    pattern: str
    name_pattern: str | None
    name_table: str | None
    format: Literal["auto", "csv", "matlab", "mdf", "tdms", "hdf5", "parquet"]
    csv: CsvParams
    channels: dict[str, ChannelParams]
    time: TimeParams
    screen: ScreenParams
    zero: ZeroParams
    checks: ChecksParams

    @field_validator("channels")
    @classmethod
    def _channels_make_a_recording(cls, channels: dict[str, ChannelParams]) -> dict[str, ChannelParams]:
        check_mapping({column: ChannelMapping.from_dict(each.model_dump()) for column, each in channels.items()})
        return channels

    @model_validator(mode="after")
    def _names_come_from_one_place(self) -> IngestParams:
        if (self.name_pattern is None) == (self.name_table is None):
            raise ValueError("name_pattern or name_table must be set, and the other null")
        if self.name_pattern is not None:
            compile_name_pattern(self.name_pattern)
        return self
