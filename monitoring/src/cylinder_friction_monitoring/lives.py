"""The lives of a fleet's cylinders on the rig: session after session, what wears, leaks, drifts, warms and is replaced.

Wear has another shape than the fault ``wear``: a gamma process whose clock is the work of the seals, ∫ p·|v| dt, and
friction that first rises with it, as the seal swells and the bore polishes, then falls. A leak is a process of its own
that begins later. Around both, oil follows the seasons, friction differs from day to day, zeros of transmitters
wander, and duty or load changes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from typing import Literal

import numpy as np
from numpy.random import Generator

from cylinder_friction import Cylinder
from cylinder_friction.rig.bench import (
    BAR_PA,
    DEFAULT_STEP_S,
    MAKEUP_GAIN,
    MOVE,
    TICK_S,
    TRUTH_COLUMNS,
    DutyCycle,
    ExternalLoad,
    RecordingMetadata,
    RigParameters,
    RigRecording,
    Row,
    balanced_state,
    default_rig,
    draw_rig,
    hand_remnant,
    lever_for_speed,
    measure,
    ornstein_uhlenbeck,
    refuse_unknown,
    simulate,
)
from cylinder_friction_monitoring.arrays import Array

Fate = Literal["healthy", "wear", "leak", "seal", "drift", "oil", "load", "duty"]
FATES: dict[Fate, str] = {
    "healthy": "nothing but seasons, days and sensors",
    "wear": "the seal wears, and a leak follows later",
    "leak": "the leak grows tenfold, friction stays",
    "seal": "the seal wears and is replaced, and nobody enters it",
    "drift": "the zero of the piston side's transmitter drifts by 1 bar",
    "oil": "the oil is replaced by one that is more viscous",
    "load": "another load from one day on",
    "duty": "another duty from one day on: faster, against a throttle",
}
"""What may become of a cylinder."""

FIRST_DAY = datetime(2025, 1, 6, 6)
_SPEEDS_M_S = (0.045, 0.022, 0.011)
_FASTER, _THROTTLE_GAIN, _LOAD_N, _DRIFT_BAR, _LEAK, _THICKER = 1.2, 6e-8, 600.0, 1.0, 10.0, 1.4


@dataclass(frozen=True)
class LifePlan:
    """How much of a cylinder's life is recorded."""

    seed: int = 0  # Seeds everything that is drawn
    sessions: int = 120
    begins: int = 60  # Session from which its fate acts
    takes: int = 60  # Sessions within which its fate is complete
    sessions_per_year: float = 365.0
    scatter: float = 0.02  # Standard deviation of friction from session to session
    autocorrelation: float = 0.5  # Of it, between neighbouring sessions
    duration_s: float = 36.0  # Of a session [s]
    sample_time_s: float = 0.005  # Of the logger [s]
    time_step_s: float = DEFAULT_STEP_S  # Of the integration [s]


@dataclass
class _Condition:
    """What a cylinder is in today, as factors on what it was when new."""

    wear: float = 0.0  # Of the seal, 1 when it should be replaced
    leakage: float = 1.0
    friction: float = 1.0
    drift_bar: float = 0.0
    share: float = 0.0  # How much of its fate has come

    @property
    def friction_factor(self) -> float:
        """Friction over that of the new seal: it rises by 13 % at a fifth of the wear, and falls from there."""
        return self.friction * (1.0 + 0.18 * self.wear / 0.2 * math.exp(1.0 - self.wear / 0.2) - 0.25 * self.wear)


def life(cylinder: Cylinder, plan: LifePlan, number: int, fate: Fate = "healthy") -> Iterator[RigRecording]:
    """Yield one recording per session of cylinder ``number`` of a fleet; equal plans give equal recordings.

    Raises:
        ValueError: The fate is not known.
    """
    refuse_unknown("fate", fate, FATES)
    draw = np.random.default_rng([plan.seed, number])
    rig = draw_rig(default_rig(cylinder), draw)
    gains = tuple(1.0 + draw.uniform(-0.002, 0.002, 2))
    rig = replace(rig, sensors=replace(rig.sensors, sample_time_s=plan.sample_time_s, pressure_gain=gains))
    rig = replace(rig, hydraulics=replace(rig.hydraulics, makeup_gain=MAKEUP_GAIN))
    days = _Days.drawn(draw, plan)
    condition = _Condition()
    for index in range(plan.sessions):
        condition.share = min(max((index - plan.begins + 1) / plan.takes, 0.0), 1.0)
        today = _today(rig, fate, condition, days, index)
        load_n = _LOAD_N if fate == "load" and condition.share > 0.0 else 0.0
        faster = _FASTER if fate == "duty" and condition.share > 0.0 else 1.0
        generator = np.random.default_rng([plan.seed, number, index + 1])
        recording, work = _session(today, plan, days, index, load_n, faster, generator, f"cylinder{number:02d}")
        yield recording
        _wear(condition, fate, work, plan, generator)


@dataclass(frozen=True)
class _Days:
    """What differs from session to session without wear, each of shape ``(sessions,)``."""

    friction: Array  # Factor
    asymmetry: Array  # Added
    temperature_c: Array
    zeros_bar: tuple[Array, Array]

    @classmethod
    def drawn(cls, generator: Generator, plan: LifePlan) -> _Days:
        count, memory = plan.sessions, -1.0 / math.log(max(plan.autocorrelation, 1e-6))
        season = 2.0 * math.pi * (np.arange(count) / plan.sessions_per_year + generator.uniform())
        temperature_c = 36.0 + 7.0 * np.sin(season) + ornstein_uhlenbeck(generator, count, 1.0, 1.5, 2.5)
        return cls(
            friction=1.0 + ornstein_uhlenbeck(generator, count, 1.0, memory, plan.scatter),
            asymmetry=ornstein_uhlenbeck(generator, count, 1.0, 3.0, 0.01),
            temperature_c=temperature_c,
            zeros_bar=(
                ornstein_uhlenbeck(generator, count, 1.0, 5.0, 0.05),
                ornstein_uhlenbeck(generator, count, 1.0, 5.0, 0.05),
            ),
        )


def _today(rig: RigParameters, fate: str, condition: _Condition, days: _Days, index: int) -> RigParameters:
    friction = replace(
        rig.friction,
        coulomb_n=rig.friction.coulomb_n * condition.friction_factor,
        piston_seal_n=rig.friction.piston_seal_n * condition.friction_factor,
        rod_seal_n=rig.friction.rod_seal_n * condition.friction_factor,
        asymmetry=rig.friction.asymmetry + float(days.asymmetry[index]),
    )
    hydraulics = replace(rig.hydraulics, leakage_m3_s_pa=rig.hydraulics.leakage_m3_s_pa * condition.leakage)
    if fate == "duty" and condition.share > 0.0:
        hydraulics = replace(hydraulics, throttle_gain=_THROTTLE_GAIN)
    if fate == "oil" and condition.share > 0.0:
        friction = replace(
            friction,
            viscous_n_s_m=_THICKER * friction.viscous_n_s_m,
            stribeck_velocity_m_s=friction.stribeck_velocity_m_s / _THICKER,
            film_velocity_m_s=friction.film_velocity_m_s / _THICKER,
        )
        hydraulics = replace(hydraulics, leakage_m3_s_pa=hydraulics.leakage_m3_s_pa / _THICKER)
    zeros = tuple(BAR_PA * float(each[index]) for each in days.zeros_bar)
    zeros = (zeros[0] + BAR_PA * condition.drift_bar, zeros[1])
    return replace(
        rig, friction=friction, hydraulics=hydraulics, sensors=replace(rig.sensors, pressure_offset_pa=zeros)
    )


def _wear(condition: _Condition, fate: str, work: float, plan: LifePlan, generator: Generator) -> None:
    """Bring what the session's work did; ``work`` is about 1 for a session of the default duty."""
    if condition.share == 0.0:
        return
    if fate in ("wear", "seal"):
        condition.wear += generator.gamma(0.5 * work) / (0.5 * plan.takes)
        if condition.wear > 0.5:
            condition.leakage *= 1.0 + generator.gamma(0.5 * work) * 0.1
    if fate == "seal" and condition.share >= 0.8 and condition.friction == 1.0:
        condition.wear, condition.leakage, condition.friction = 0.0, 0.7, 1.06
    if fate == "leak":
        condition.leakage = _LEAK**condition.share
    if fate == "drift":
        condition.drift_bar = _DRIFT_BAR * condition.share


def _session(
    rig: RigParameters,
    plan: LifePlan,
    days: _Days,
    index: int,
    load_n: float,
    faster: float,
    generator: Generator,
    name: str,
) -> tuple[RigRecording, float]:
    """Return the recording of a session and its work on the seals, relative to that of the default duty."""
    stroke_m = rig.hydraulics.stroke_m
    ticks = round(plan.duration_s / TICK_S) + 2
    load = ExternalLoad.of_time(np.full(ticks, load_n))
    position_m = stroke_m * generator.uniform(0.2, 0.3)
    pressure_pa = generator.uniform(4.0, 12.0) * BAR_PA
    start = balanced_state(rig, position_m, pressure_pa, float(days.temperature_c[index]), load_n)
    lever = DutyCycle(np.array(_strokes(rig, generator, faster)), hand_remnant(generator, plan.duration_s))
    drift = np.full(math.ceil(plan.duration_s) + 3, float(days.friction[index]))
    trace = simulate(rig, lever, start, plan.duration_s, drift, plan.time_step_s, external_force=load)
    logger = measure(rig.sensors, trace, generator)
    truth = trace[list(TRUTH_COLUMNS)].iloc[:: round(plan.sample_time_s / TICK_S)].reset_index(drop=True)
    began = FIRST_DAY + timedelta(days=365.0 / plan.sessions_per_year * index)
    metadata = RecordingMetadata(
        name=f"{name}_{began:%Y%m%dT%H%M}",
        condition="1",
        session=f"{name}_{began:%Y%m%dT%H%M}",
        sample_time_s=plan.sample_time_s,
        cylinder=rig.cylinder.name,
        start=f"{began:%Y-%m-%dT%H:%M:%S}Z",
        start_source="the simulated logger",
        asset=name,
    )
    power = trace["pressure_2_pa"].to_numpy() * np.abs(trace["velocity_m_s"].to_numpy())
    return RigRecording(metadata, logger, truth), float(power.mean()) / _USUAL_WORK


_USUAL_WORK = 1.5e4  # Mean of pressure times speed of the default duty [W/m²]


def _strokes(rig: RigParameters, generator: Generator, faster: float) -> list[Row]:
    """Return strokes out and back at three speeds, the valve closed between them."""
    low, high = 0.2 * rig.hydraulics.stroke_m, 0.62 * rig.hydraulics.stroke_m
    rows: list[Row] = []
    for speed in _SPEEDS_M_S * 2:
        for sign in (1.0, -1.0):
            target = lever_for_speed(rig, sign * faster * speed * generator.uniform(0.9, 1.1))
            hold_s = 0.4 * (high - low) / (faster * speed) if speed < 0.02 else 9.0
            rows.append((MOVE, target, 0.2, hold_s, 0.0, low, high, 0.1, 0.0, 0.1))
            rows.append((MOVE, 0.0, 0.15, generator.uniform(1.2, 1.5), 0.0, -1.0, 9.0, 0.3, 0.0, 0.0))
    return rows
