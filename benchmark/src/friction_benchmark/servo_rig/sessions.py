"""Sessions on the servo rig: three conditions, drawn parameters, sensors, and recordings with the truth beside them."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pandas as pd
from numpy.random import Generator
from scipy import signal

from cylinder_friction.arrays import Array
from cylinder_friction.recordings.columns import OIL_TEMPERATURE, POSITION, PRESSURES, TIME
from cylinder_friction.recordings.recording import Recording, RecordingMetadata, SensorUncertainty
from friction_benchmark.servo_rig.dynamics import TICK_S
from friction_benchmark.servo_rig.parameters import BAR, CYLINDER, GREATEST_OFFSET_PA, Drive, Seals, Sensors
from friction_benchmark.servo_rig.references import random_steps, sine_sweeps, trapezoids
from friction_benchmark.servo_rig.simulate import simulate

Mounting = Literal["horizontal", "vertical"]
"""Vertical: the mass hangs on the rod's upper end, on a spring; both resist extension, and nobody measures them."""

SPRING_N_M, GRAVITY_M_S2 = 1500.0, 9.81
SEED_WORD = 4025  # First word of every seed, so that no other simulation shares random numbers with this one


@dataclass(frozen=True)
class Condition:
    """A duty cycle at a supply pressure."""

    title: str
    duty: Callable[[Generator, int], Array]
    supply_bar: float
    integral_gain_1_s2: float = 0.0  # A P controller where 0


CONDITIONS = {
    "1": Condition("sweeps, 160 bar", sine_sweeps, 160.0),
    "2": Condition("trapezoids, 185 bar", trapezoids, 185.0, 10.0),
    "3": Condition("steps, 210 bar", random_steps, 210.0),
}


@dataclass(frozen=True)
class SessionPlan:
    """How sessions are recorded."""

    seed: int = 0
    sessions: int = 6  # In each condition
    duration_s: float = 40.0  # Of a session's one recording [s]
    mounting: Mounting = "horizontal"
    sample_time_s: float = 0.004  # Of the logger; a multiple of 1 ms [s]


@dataclass(frozen=True, eq=False)
class ServoSession:
    """A session's recording, raw, and what no logger sees, at its rows: shape ``(n,)``."""

    recording: Recording
    true_friction_n: Array
    true_load_n: Array  # Resists extension [N]


def record_sessions(plan: SessionPlan) -> list[ServoSession]:
    """Return all sessions of a plan, by condition and number; equal plans give equal bits.

    A plan that differs in its sample time alone gives the same motion, friction and sensors' zeros, logged otherwise.
    """
    return [record(plan, name, number) for name in CONDITIONS for number in range(1, plan.sessions + 1)]


def record(plan: SessionPlan, condition: str, number: int) -> ServoSession:
    """Return one session, drawn from its own random numbers."""
    words = [SEED_WORD, plan.seed, int(condition), number]
    seals, drive, sensors = draw(np.random.default_rng([*words, 0]), condition, plan.mounting)
    sensors = sensors._replace(sample_time_s=plan.sample_time_s)
    rows = round(plan.duration_s / TICK_S)
    reference_m = CONDITIONS[condition].duty(np.random.default_rng([*words, 1]), rows + 1)
    trace = simulate(seals, drive, reference_m)
    logged = measure(sensors, trace, np.random.default_rng([*words, 2]))
    name = f"servo{condition}_session{number:02d}"
    step_pa = sensors.pressure_span_pa / 2**sensors.pressure_bits
    stated = dict.fromkeys(PRESSURES, SensorUncertainty(GREATEST_OFFSET_PA / np.sqrt(3.0), 0.0, step_pa, True))
    metadata = RecordingMetadata(
        name, condition, name, plan.sample_time_s, CYLINDER.name, load=plan.mounting, uncertainty=stated
    )
    truth = trace.iloc[:: _stride(sensors)]
    return ServoSession(Recording(metadata, logged), truth["friction_n"].to_numpy(), truth["load_force_n"].to_numpy())


def draw(generator: Generator, condition: str, mounting: Mounting) -> tuple[Seals, Drive, Sensors]:
    """Return what one session is made from: seals worn and lubricated a little otherwise, oil, supply, zeros."""
    seals = Seals(
        wear=float(np.exp(generator.normal(0.0, 0.05))),
        rod_asymmetry=generator.normal(0.12, 0.03),
        ageing=generator.uniform(0.05, 0.09),
        film_velocity_m_s=0.02 * float(np.exp(generator.normal(0.0, 0.15))),
    )
    drive = Drive(
        supply_pa=(CONDITIONS[condition].supply_bar + generator.uniform(-4.0, 4.0)) * BAR,
        tank_pa=generator.uniform(3.0, 6.0) * BAR,
        air_share=generator.uniform(0.003, 0.012),
        cross_leakage=generator.uniform(1e-13, 4e-13),
        oil_c=generator.uniform(28.0, 55.0),
        warming_c_s=generator.uniform(0.0, 0.02),
        integral_gain_1_s2=CONDITIONS[condition].integral_gain_1_s2,
    )
    if mounting == "vertical":
        drive = drive._replace(gravity_n=CYLINDER.moving_mass_kg * GRAVITY_M_S2, spring_n_m=SPRING_N_M)
    first, second = generator.uniform(-GREATEST_OFFSET_PA, GREATEST_OFFSET_PA, 2)
    return seals, drive, Sensors(offset_1_pa=float(first), offset_2_pa=float(second))


def measure(sensors: Sensors, trace: pd.DataFrame, generator: Generator) -> pd.DataFrame:
    """Return a recording's table in SI units: time, both pressures, position, oil temperature."""
    stride = _stride(sensors)
    columns = {TIME: trace["time_s"].to_numpy()[::stride]}
    sections = signal.bessel(4, sensors.anti_alias_hz, fs=1.0 / TICK_S, norm="mag", output="sos")
    step_pa = sensors.pressure_span_pa / 2**sensors.pressure_bits
    for name, offset_pa in zip(PRESSURES, (sensors.offset_1_pa, sensors.offset_2_pa), strict=True):
        true_pa = trace[name].to_numpy()
        filtered_pa, _ = signal.sosfilt(sections, true_pa, zi=signal.sosfilt_zi(sections) * true_pa[0])
        seen_pa = filtered_pa[::stride] + offset_pa
        seen_pa += generator.normal(0.0, sensors.pressure_noise_pa, len(seen_pa))
        columns[name] = np.clip(np.round(seen_pa / step_pa) * step_pa, 0.0, sensors.pressure_span_pa)
    step_m = CYLINDER.stroke_m / 2**sensors.position_bits
    seen_m = trace["position_m"].to_numpy()[::stride]
    noise_m = generator.normal(0.0, sensors.position_noise_m, len(seen_m))
    columns[POSITION] = np.round((seen_m + noise_m) / step_m) * step_m
    columns[OIL_TEMPERATURE] = np.round(trace["oil_temperature_c"].to_numpy()[::stride], 1)
    return pd.DataFrame(columns)


def as_seen_by(recording: Recording, there: tuple[float, float], load_n: Array | float = 0.0) -> Recording:
    """Return the recording with the pressures at which another cylinder's piston is pushed as hard.

    ``there`` are the other one's areas, piston side and rod side [m²]. What the rod works against, ``load_n``, is taken
    off the piston side.
    """
    first, second = (recording.column(name) for name in PRESSURES)
    push_n, pull_n = first * CYLINDER.piston_area_m2 - load_n, second * CYLINDER.annulus_area_m2
    return recording.with_columns(**dict(zip(PRESSURES, (push_n / there[0], pull_n / there[1]), strict=True)))


def _stride(sensors: Sensors) -> int:
    """Return how many rows of a trace lie between two samples."""
    stride = round(sensors.sample_time_s / TICK_S)
    if stride < 1 or abs(stride * TICK_S - sensors.sample_time_s) > 1e-9:
        raise ValueError(f"sample_time_s: got {sensors.sample_time_s} s, but expected a multiple of {TICK_S} s")
    return stride
