"""Simulate the lives of a fleet's cylinders on the rig, session after session.

Wear is a gamma process whose clock is the work of the seals, ∫ p·|v| dt. Friction first rises with it, as the seal
swells and the bore polishes, then falls. A leak begins later. Oil follows the seasons, friction differs from day to
day, zeros of transmitters wander, and duty or load changes.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from typing import Literal

import numpy as np
from numpy.random import Generator

import cylinder_friction.rig.bench as rig_bench
from cylinder_friction import Cylinder
from cylinder_friction_monitoring.arrays import Array

Fate = Literal["healthy", "wear", "leak", "seal", "drift", "oil", "load", "duty"]
FATES: dict[Fate, str] = {
    "healthy": "nothing but seasons, days and sensors",
    "wear": "the seal wears, and a leak follows later",
    "leak": "the leak grows tenfold, friction stays",
    "seal": "the seal wears and is replaced, and nobody enters it",
    "drift": "the zero of the piston side's transmitter drifts by 1 bar",
    "oil": "the oil is replaced by one that is 40 % more viscous",
    "load": "a load of 600 N",
    "duty": "another duty, 20 % faster and against a throttle",
}
"""What can happen to a cylinder."""

FIRST_DAY = datetime(2025, 1, 6, 6)
_SPEEDS_M_S = (0.045, 0.022, 0.011)
_FASTER, _THROTTLE_GAIN, _LOAD_N, _DRIFT_BAR, _LEAK, _THICKER = 1.2, 6e-8, 600.0, 1.0, 10.0, 1.4


@dataclass(frozen=True)
class LifePlan:
    """The recorded part of a cylinder's life."""

    seed: int = 0  # Seeds everything that is drawn
    sessions: int = 120
    begins: int = 60  # First session of its fate
    takes: int = 60  # Number of sessions from there until its fate is complete
    sessions_per_year: float = 365.0
    scatter: float = 0.02  # Standard deviation of friction from session to session
    autocorrelation: float = 0.5  # Autocorrelation of that scatter between neighbouring sessions
    duration_s: float = 36.0  # Duration of a session [s]
    sample_time_s: float = 0.005  # Sample time of the logger [s]
    time_step_s: float = rig_bench.DEFAULT_STEP_S  # Time step of the integration [s]


@dataclass
class _Condition:
    """The state of a cylinder on one day, as factors relative to a new cylinder."""

    wear: float = 0.0  # Wear of the seal; at 1 it should be replaced
    leakage: float = 1.0
    friction: float = 1.0
    drift_bar: float = 0.0
    share: float = 0.0  # Completed share of its fate

    @property
    def friction_factor(self) -> float:
        """Ratio of friction to that of a new seal: 13 % more at a fifth of the wear, then less and less."""
        return self.friction * (1.0 + 0.18 * self.wear / 0.2 * math.exp(1.0 - self.wear / 0.2) - 0.25 * self.wear)


def life(cylinder: Cylinder, plan: LifePlan, number: int, fate: Fate = "healthy") -> Iterator[rig_bench.RigRecording]:
    """Simulate cylinder ``number`` and yield one recording per session; equal plans give equal recordings.

    The truth includes the effect of the fate: factors of friction and leak, and a zero [bar]. An unknown fate raises
    ``ValueError``.
    """
    rig_bench.refuse_unknown("fate", fate, FATES)
    draw = np.random.default_rng([plan.seed, number])
    rig = rig_bench.draw_rig(rig_bench.default_rig(cylinder), draw)
    gains = tuple(1.0 + draw.uniform(-0.002, 0.002, 2))
    rig = replace(rig, sensors=replace(rig.sensors, sample_time_s=plan.sample_time_s, pressure_gain=gains))
    rig = replace(rig, hydraulics=replace(rig.hydraulics, makeup_gain=rig_bench.MAKEUP_GAIN))
    days = _Days.drawn(draw, plan)
    condition = _Condition()
    for index in range(plan.sessions):
        condition.share = min(max((index - plan.begins + 1) / plan.takes, 0.0), 1.0)
        acting: Fate = fate if condition.share > 0.0 else "healthy"
        today = _today(rig, acting, condition, days, index)
        generator = np.random.default_rng([plan.seed, number, index + 1])
        recording, work = _session(today, plan, acting, days, index, generator, f"cylinder{number:02d}")
        done = {"friction_factor": condition.friction_factor, "leak_factor": condition.leakage}
        yield replace(recording, truth=recording.truth.assign(**done, zero_bar=condition.drift_bar))
        _wear(condition, acting, work, plan, generator)


@dataclass(frozen=True)
class _Days:
    """Differences between sessions that are not due to wear, each of shape ``(sessions,)``."""

    friction: Array  # Factor on friction
    asymmetry: Array  # Term added to the asymmetry of friction
    temperature_c: Array
    zeros_bar: tuple[Array, Array]

    @classmethod
    def drawn(cls, generator: Generator, plan: LifePlan) -> "_Days":
        count, memory = plan.sessions, -1.0 / math.log(max(plan.autocorrelation, 1e-6))
        season = 2.0 * math.pi * (np.arange(count) / plan.sessions_per_year + generator.uniform())
        temperature_c = 36.0 + 7.0 * np.sin(season) + rig_bench.ornstein_uhlenbeck(generator, count, 1.0, 1.5, 2.5)
        return cls(
            friction=1.0 + rig_bench.ornstein_uhlenbeck(generator, count, 1.0, memory, plan.scatter),
            asymmetry=rig_bench.ornstein_uhlenbeck(generator, count, 1.0, 3.0, 0.01),
            temperature_c=temperature_c,
            zeros_bar=tuple(rig_bench.ornstein_uhlenbeck(generator, count, 1.0, 5.0, 0.05) for _ in range(2)),  # type: ignore[arg-type]
        )


def _today(
    rig: rig_bench.RigParameters, acting: Fate, condition: _Condition, days: _Days, index: int
) -> rig_bench.RigParameters:
    friction = replace(
        rig.friction,
        coulomb_n=rig.friction.coulomb_n * condition.friction_factor,
        piston_seal_n=rig.friction.piston_seal_n * condition.friction_factor,
        rod_seal_n=rig.friction.rod_seal_n * condition.friction_factor,
        asymmetry=rig.friction.asymmetry + float(days.asymmetry[index]),
    )
    hydraulics = replace(rig.hydraulics, leakage_m3_s_pa=rig.hydraulics.leakage_m3_s_pa * condition.leakage)
    if acting == "duty":
        hydraulics = replace(hydraulics, throttle_gain=_THROTTLE_GAIN)
    if acting == "oil":
        friction = replace(
            friction,
            viscous_n_s_m=_THICKER * friction.viscous_n_s_m,
            stribeck_velocity_m_s=friction.stribeck_velocity_m_s / _THICKER,
            film_velocity_m_s=friction.film_velocity_m_s / _THICKER,
        )
        hydraulics = replace(hydraulics, leakage_m3_s_pa=hydraulics.leakage_m3_s_pa / _THICKER)
    zeros = tuple(rig_bench.BAR_PA * float(each[index]) for each in days.zeros_bar)
    zeros = (zeros[0] + rig_bench.BAR_PA * condition.drift_bar, zeros[1])
    return replace(
        rig, friction=friction, hydraulics=hydraulics, sensors=replace(rig.sensors, pressure_offset_pa=zeros)
    )


def _wear(condition: _Condition, acting: Fate, work: float, plan: LifePlan, generator: Generator) -> None:
    """Add the wear of one session; its ``work`` is about 1 for the default duty."""
    if acting in ("wear", "seal"):
        condition.wear += generator.gamma(0.5 * work) / (0.5 * plan.takes)
        if condition.wear > 0.5:
            condition.leakage *= 1.0 + generator.gamma(0.5 * work) * 0.1
    if acting == "seal" and condition.share >= 0.8 and condition.friction == 1.0:
        condition.wear, condition.leakage, condition.friction = 0.0, 0.7, 1.06
    if acting == "leak":
        condition.leakage = _LEAK**condition.share
    if acting == "drift":
        condition.drift_bar = _DRIFT_BAR * condition.share


def _session(
    rig: rig_bench.RigParameters, plan: LifePlan, acting: Fate, days: _Days, index: int, generator: Generator, name: str
) -> tuple[rig_bench.RigRecording, float]:
    """Record a session; also return its work on the seals, relative to the default duty."""
    load_n = _LOAD_N if acting == "load" else 0.0
    load = rig_bench.ExternalLoad.of_time(np.full(round(plan.duration_s / rig_bench.TICK_S) + 2, load_n))
    position_m = rig.hydraulics.stroke_m * generator.uniform(0.2, 0.3)
    pressure_pa = generator.uniform(4.0, 12.0) * rig_bench.BAR_PA
    start = rig_bench.balanced_state(rig, position_m, pressure_pa, float(days.temperature_c[index]), load_n)
    strokes = np.array(_strokes(rig, generator, _FASTER if acting == "duty" else 1.0))
    lever = rig_bench.DutyCycle(strokes, rig_bench.hand_remnant(generator, plan.duration_s))
    drift = np.full(math.ceil(plan.duration_s) + 3, float(days.friction[index]))
    trace = rig_bench.simulate(rig, lever, start, plan.duration_s, drift, plan.time_step_s, external_force=load)
    logger = rig_bench.measure(rig.sensors, trace, generator)
    every = round(plan.sample_time_s / rig_bench.TICK_S)
    truth = trace[list(rig_bench.TRUTH_COLUMNS)].iloc[::every].reset_index(drop=True)
    began = FIRST_DAY + timedelta(days=365.0 / plan.sessions_per_year * index)
    session = f"{name}_{began:%Y%m%dT%H%M}"
    metadata = rig_bench.RecordingMetadata(
        name=session,
        condition="1",
        session=session,
        sample_time_s=plan.sample_time_s,
        cylinder=rig.cylinder.name,
        start=f"{began:%Y-%m-%dT%H:%M:%S}Z",
        start_source="the simulated logger",
        asset=name,
    )
    power = trace["pressure_2_pa"].to_numpy() * np.abs(trace["velocity_m_s"].to_numpy())
    return rig_bench.RigRecording(metadata, logger, truth), float(power.mean()) / _USUAL_WORK


_USUAL_WORK = 1.5e4  # Mean of pressure times speed of the default duty [W/m²]


def _strokes(rig: rig_bench.RigParameters, generator: Generator, faster: float) -> list[rig_bench.Row]:
    """Plan extending and retracting strokes at three speeds, with the valve closed between them."""
    low, high = 0.2 * rig.hydraulics.stroke_m, 0.62 * rig.hydraulics.stroke_m
    rows: list[rig_bench.Row] = []
    for speed in _SPEEDS_M_S * 2:
        for sign in (1.0, -1.0):
            target = rig_bench.lever_for_speed(rig, sign * faster * speed * generator.uniform(0.9, 1.1))
            hold_s = 0.4 * (high - low) / (faster * speed) if speed < 0.02 else 9.0
            rows.append((rig_bench.MOVE, target, 0.2, hold_s, 0.0, low, high, 0.1, 0.0, 0.1))
            rows.append((rig_bench.MOVE, 0.0, 0.15, generator.uniform(1.2, 1.5), 0.0, -1.0, 9.0, 0.3, 0.0, 0.0))
    return rows
