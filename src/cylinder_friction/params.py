"""Every parameter of the pipeline, typed and frozen; an unknown key, a wrong type or an impossible value is refused.

``params.yaml`` is the composed configuration (from ``conf/``) that every stage reads. Only ``stages`` import this
module: the layers below take plain arguments.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, Literal

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from cylinder_friction.recordings.mapping import ChannelMapping, check_mapping, compile_name_pattern
from cylinder_friction.signals.zero_phase import SavitzkyGolay

PARAMS_FILE = Path("params.yaml")

Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
Fraction = Annotated[float, Field(ge=0.0, lt=1.0)]
Count = Annotated[int, Field(ge=1)]
Seed = Annotated[int, Field(ge=0, lt=2**31)]


class ParamsError(ValueError):
    """A configuration that is refused; the message names the key."""


class _Section(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class CylinderParams(_Section):
    """Geometry; see ``cylinder.Cylinder``."""

    name: str
    bore_diameter_m: Positive
    rod_diameter_m: Positive
    stroke_m: Positive
    moving_mass_kg: Positive


class RecordParams(_Section):
    """The simulated rig's campaign; its hand lever and its trace run in milliseconds."""

    seed: Seed
    sessions_per_test: Annotated[int, Field(ge=0)]
    recordings_per_session: Count
    duration_s: Positive
    sample_time_s: Positive
    time_step_s: Annotated[float, Field(gt=0.0, le=2e-4)]
    supply: Literal["didactic", "industrial"]
    zeroed: bool
    residual_offset_bar: NotNegative
    fault: Literal["none", "wear", "tight_seal", "aeration", "sensor_drift", "bent_rod"]

    @field_validator("duration_s", "sample_time_s")
    @classmethod
    def _whole_milliseconds(cls, seconds: float) -> float:
        if not math.isclose(seconds, round(seconds, 3), rel_tol=1e-9) or round(seconds, 3) == 0.0:
            raise ValueError("must be a whole number of milliseconds, such as 0.005")
        return seconds

    @field_validator("time_step_s")
    @classmethod
    def _divides_a_millisecond(cls, seconds: float) -> float:
        if not math.isclose(round(1e-3 / seconds) * seconds, 1e-3, rel_tol=1e-9):
            raise ValueError("must divide one millisecond without remainder, such as 5.0e-5")
        return seconds


class ChannelParams(_Section):
    """Where one column comes from: the logger's channel, its unit, and -1 where the sensor is mounted backwards."""

    channel: str
    unit: str
    sign: Literal[1, -1] = 1


class CsvParams(_Section):
    """How the lines of a CSV file are cut into numbers."""

    delimiter: Annotated[str, Field(min_length=1, max_length=1)]
    decimal: Literal[".", ","]
    encoding: str


class IngestParams(_Section):
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


class MovingAverageParams(_Section):
    """The paper's chain, causal as published or centred: windows in samples."""

    window: Count
    acceleration_window: Count


class SavitzkyGolayParams(_Section):
    """Windows in samples and polynomial orders of the zero-phase filter."""

    pressure_window: Count
    pressure_order: Count
    velocity_window: Count
    velocity_order: Count
    acceleration_window: Count
    acceleration_order: Count

    @model_validator(mode="after")
    def _windows_hold_their_orders(self) -> SavitzkyGolayParams:
        SavitzkyGolay(**self.model_dump())
        return self


class RtsParams(_Section):
    """Rauch-Tung-Striebel smoother with a constant-jerk position model and a random-walk pressure model."""

    position_noise_m: Positive
    jerk_noise_m_s3: Positive
    pressure_noise_pa: Positive
    pressure_rate_pa_s: Positive


class FilterParams(_Section):
    """How raw signals become smooth ones with velocity and acceleration, off line; the audit judges all four."""

    method: Literal["moving_average", "moving_average_centred", "savitzky_golay", "rts"]
    moving_average: MovingAverageParams
    savitzky_golay: SavitzkyGolayParams
    rts: RtsParams


class SplitParams(_Section):
    """Which sessions are held out, for each test; sessions are drawn by a hash of their name and the seed."""

    test_sessions: Count
    validation_sessions: Count
    seed: Seed


class LabelParams(_Section):
    """Friction from the equation of motion, and the mask of rows that may be used."""

    stiffness: Literal["none", "trapped_oil", "external", "paper_literal"]
    bulk_modulus_pa: Positive
    external_stiffness_n_m: NotNegative
    stiffness_reference_m: NotNegative
    dead_volume_m3: Positive
    end_stop_margin_m: NotNegative
    event_window_s: Positive
    split: SplitParams


class HybridParams(_Section):
    """One LSTM + random forest hybrid: what the paper's Table I tunes."""

    layers: Count
    nodes: Count
    dropout: Fraction
    learning_rate: Positive
    forest_trees: Count
    forest_depth: Count


class TrainingParams(_Section):
    """How a hybrid is trained."""

    epochs: Count
    patience: Count
    sequence_length: Count
    burn_in: Annotated[int, Field(ge=0)]
    batch_size: Count
    schedule: Literal["constant", "cosine"]
    forest_rows: Count
    forest_leaf: Count


class SpaceParams(_Section):
    """Where the search looks: lists of choices and ranges ``[lowest, highest]``."""

    layers: list[Count]
    nodes: list[Count]
    dropout: list[Fraction]
    learning_rate: Annotated[tuple[Positive, Positive], Field(strict=False)]
    forest_trees: Annotated[tuple[Count, Count], Field(strict=False)]
    forest_depth: Annotated[tuple[Count, Count], Field(strict=False)]

    @model_validator(mode="after")
    def _ranges_go_up(self) -> SpaceParams:
        for key in ("learning_rate", "forest_trees", "forest_depth"):
            lowest, highest = getattr(self, key)
            if lowest > highest:
                raise ValueError(f"{key}: lowest {lowest} is above highest {highest}; swap them")
        return self


class SearchParams(_Section):
    """Optuna's search over a hybrid's hyperparameters."""

    seed: Seed
    hybrid: Literal["force_balance", "paper"]
    trials: Count
    startup_trials: Count
    maximum_multiply_adds: Count
    space: SpaceParams
    training: TrainingParams


class TrainParams(_Section):
    """The final training: the default hybrid with the best parameters found, the paper's with the published ones."""

    seed: Seed
    device: Literal["auto", "cpu", "cuda"]
    use_search: bool
    hybrid: HybridParams
    paper_hybrid: HybridParams
    training: TrainingParams
    paper_training: TrainingParams


class LugreParams(_Section):
    """LuGre's identification on Test 1 alone."""

    seed: Seed
    test: str
    population: Count
    generations: Count
    simulated_recordings: Count
    velocity_dead_band_m_s: NotNegative
    damping_ratio: Positive
    confidence: Annotated[float, Field(gt=0.0, lt=1.0)]


class CompareParams(_Section):
    """The comparison on held-out recordings."""

    figure_duration_s: Positive
    autocorrelation_lags: Count
    timing_repeats: Count
    standstill_velocity_m_s: Positive
    stribeck_velocity_m_s: Positive
    reversal_window_s: Positive
    maximum_lag_s: Positive
    bootstrap_repeats: Count
    bootstrap_block_s: Positive
    seed: Seed


class RegisterParams(_Section):
    """The promotion gate."""

    model_name: str
    candidate: Literal["hybrid", "paper_hybrid"]
    tolerance_percent: NotNegative


class Params(_Section):
    """The whole configuration, one section a stage."""

    cylinder: CylinderParams
    record: RecordParams
    ingest: IngestParams
    filter: FilterParams
    label: LabelParams
    search: SearchParams
    train: TrainParams
    lugre: LugreParams
    compare: CompareParams
    register_: RegisterParams = Field(alias="register")

    @model_validator(mode="after")
    def _end_stop_margin_leaves_room(self) -> Params:
        if 2.0 * self.label.end_stop_margin_m >= self.cylinder.stroke_m:
            raise ValueError(
                f"label.end_stop_margin_m is {self.label.end_stop_margin_m} m at either end, which leaves nothing of "
                f"the stroke of {self.cylinder.stroke_m} m; make it smaller"
            )
        return self


def check_params(content: Any, where: str) -> Params:
    """Returns the typed parameters, or refuses with every offending key named.

    Args:
        content: What the YAML file or Hydra gave.
        where: Name of the source, for the message.

    Raises:
        ParamsError: A key is unknown or missing, a type is wrong or a value impossible.
    """
    try:
        return Params.model_validate(content)
    except ValidationError as error:
        lines = [_explain(dict(problem)) for problem in error.errors()]
        raise ParamsError(f"{where}: refused, nothing was run\n  " + "\n  ".join(lines)) from None


def load_params(path: Path = PARAMS_FILE) -> Params:
    """Reads and checks ``params.yaml``."""
    if not path.is_file():
        raise ParamsError(f"{path}: not there; run `make params` in the project's folder")
    return check_params(yaml.safe_load(path.read_text(encoding="utf-8")), str(path))


def _explain(problem: dict[str, Any]) -> str:
    key = ".".join(str(part) for part in problem["loc"]) or "(whole file)"
    if problem["type"] == "extra_forbidden":
        return f"{key}: unknown key; check its spelling against conf/"
    if problem["type"] == "missing":
        return f"{key}: missing; run `make params` to compose it from conf/"
    got = "" if problem["type"] == "value_error" and not problem["loc"] else f", but got {problem['input']!r}"
    return f"{key}: {problem['msg'].removeprefix('Value error, ')}{got}"
