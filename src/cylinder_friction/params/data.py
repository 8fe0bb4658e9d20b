"""Parameters of the stages that make data: the rig's campaign, your own logs, filters and labels."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, field_validator, model_validator

from cylinder_friction.labelling.load import LoadPlan
from cylinder_friction.params.section import Count, NotNegative, Positive, Section, Seed
from cylinder_friction.recordings.checks.limits import CheckRules, LoadMode
from cylinder_friction.recordings.formats.format import CsvOptions
from cylinder_friction.recordings.logs import NameRules, StartRules
from cylinder_friction.recordings.mapping.channel_mapping import ChannelMapping, check_mapping
from cylinder_friction.recordings.timeline.timestamps import TimeRules
from cylinder_friction.signals.zero_phase import SavitzkyGolay


class IngestParams(Section):
    """The folder to read, and how its files become recordings. The classes of the rules check their own numbers."""

    source: str
    # Folder of true friction; DVC needs one even if no true friction is known
    truth: Annotated[str, Field(min_length=1)]
    load: LoadMode
    oil_temperature: Literal["recorded", "input"]
    pattern: str
    name_pattern: str | None
    csv: CsvOptions
    channels: dict[str, ChannelMapping]
    time: TimeRules
    start: StartRules
    asset: str
    database: str | None
    checks: CheckRules

    @field_validator("channels")
    @classmethod
    def _channels_make_a_recording(cls, channels: dict[str, ChannelMapping]) -> dict[str, ChannelMapping]:
        check_mapping(channels)
        return channels

    @field_validator("name_pattern")
    @classmethod
    def _names_a_session(cls, pattern: str | None) -> str | None:
        return NameRules(pattern).pattern


class AdaptiveParams(Section):
    """Limits of the windows on each side of a sample, and the width of the confidence intervals that choose them."""

    shortest_s: Positive
    longest_s: Positive
    confidence: Positive

    @model_validator(mode="after")
    def _shortest_first(self) -> AdaptiveParams:
        if self.shortest_s > self.longest_s:
            raise ValueError(f"shortest_s must not exceed longest_s, but got {self.shortest_s} and {self.longest_s}")
        return self


class MovingAverageParams(Section):
    """Windows of the paper's filter chain, in samples; the chain is causal as published, or centred."""

    window: Count
    acceleration_window: Count


class RtsParams(Section):
    """Rauch-Tung-Striebel smoother with a constant-jerk position model and a random-walk pressure model."""

    pressure_time_s: Positive
    motion_time_s: Positive


class FilterParams(Section):
    """How raw signals are smoothed and differentiated off line; the label audit compares all methods."""

    method: Literal["adaptive", "moving_average", "moving_average_centred", "savitzky_golay", "rts"]
    adaptive: AdaptiveParams
    moving_average: MovingAverageParams
    savitzky_golay: SavitzkyGolay
    rts: RtsParams


class SplitParams(Section):
    """Which sessions are held out in each condition: named ones, or else drawn by a hash of their name and the seed."""

    held_out: list[str]
    test_sessions: Count
    validation_sessions: Count
    calibration_sessions: Annotated[int, Field(ge=0)]
    seed: Seed


class OffsetParams(Section):
    """The offset of the pressure sensors' zeros in each session; see ``labelling.OffsetPlan``."""

    common_load: bool
    identify: Literal["auto", "always", "never"]
    slowest_m_s: Positive
    settling_s: NotNegative
    block_s: Positive
    asymmetry: NotNegative
    asymmetry_sd: NotNegative
    drift_s: Positive


class LabelParams(Section):
    """How friction is computed from the equation of motion, and which rows are usable."""

    inertia: Literal["given", "identified"]
    identify: LoadPlan
    stiffness: Literal["none", "trapped_oil", "external", "paper_literal"]
    bulk_modulus_pa: Positive
    external_stiffness_n_m: NotNegative
    stiffness_reference_m: NotNegative
    dead_volume_m3: Positive
    end_stop_margin_m: NotNegative
    event_window_s: Positive
