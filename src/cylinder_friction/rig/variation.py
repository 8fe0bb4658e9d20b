"""What differs from rig to rig, and on one rig from session to session.

``draw_rig`` varies one rig within its tolerances. ``draw_wide_rig`` draws any rig of this size, to evaluate on an
unseen rig and to train on many. Its ranges are design values that include the known ranges of seals of this size:
breakaway of 0.5 to 3 bar on the piston, Stribeck velocities of 2 to 30 mm/s, presliding stiffness of 1 to 100 N/µm,
damping ratios of 0.3 to 1. Cylinder, stroke and moving mass do not change.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator

from cylinder_friction.arrays import Array
from cylinder_friction.rig.integration import DRIFT_STEP_S
from cylinder_friction.rig.lever import ornstein_uhlenbeck
from cylinder_friction.rig.parameters import (
    BAR_PA,
    FrictionParameters,
    HydraulicParameters,
    RigParameters,
    SensorParameters,
)

PAUSE_S = 300.0  # Pause between two recordings of a session [s]

CALM_DAMPING = 1.3
"""Greatest ratio of presliding to viscous damping; the default rig has 1.33. With a greater ratio, the viscous damping
of warm oil no longer outweighs the energy of the fading presliding damping: the rig chatters at the oil's resonance."""


@dataclass(frozen=True)
class Session:
    """One stretch of laboratory work with one calibration."""

    rig: RigParameters  # The rig as it is that day, throttle set, sensors calibrated
    oil_temperature_c: float  # Oil temperature at the beginning [°C]
    drift: Array  # Slow factor on Coulomb friction through the session, one value each second

    def drift_from(self, time_s: float, duration_s: float) -> Array:
        """Compute the factor for a recording that begins ``time_s`` into the session."""
        first = int(time_s / DRIFT_STEP_S)
        return self.drift[first : first + math.ceil(duration_s / DRIFT_STEP_S) + 2]


def draw_rig(rig: RigParameters, generator: Generator) -> RigParameters:
    """Draw one specimen of the rig: its friction, bore, valve and potentiometer within their tolerances."""
    friction, hydraulics = rig.friction, rig.hydraulics
    about = generator.uniform(0.95, 1.05, 7)
    friction = replace(
        friction,
        coulomb_n=friction.coulomb_n * about[0],
        asymmetry=friction.asymmetry * about[1],
        piston_seal_n=friction.piston_seal_n * about[2],
        rod_seal_n=friction.rod_seal_n * about[3],
        static_ratio=1.0 + (friction.static_ratio - 1.0) * about[4],
        stribeck_velocity_m_s=friction.stribeck_velocity_m_s * about[5],
        viscous_n_s_m=friction.viscous_n_s_m * about[6],
        # The ripple is 3 to 5 % in all.
        ripple=tuple(np.array(friction.ripple) * generator.uniform(0.75, 1.25)),
        ripple_length_m=tuple(np.array(friction.ripple_length_m) * generator.uniform(0.85, 1.15, 3)),
        ripple_phase_rad=tuple(generator.uniform(0.0, 2.0 * math.pi, 3)),
    )
    hydraulics = replace(
        hydraulics,
        valve_overlap=float(generator.uniform(0.08, 0.15)),
        air_fraction=float(generator.uniform(0.003, 0.007)),
    )
    first, second = generator.uniform(-8e-5, 8e-5, 2)
    sensors = replace(
        rig.sensors, linearity_m=(float(first), float(second)), temperature_offset_c=float(generator.uniform(-0.5, 0.5))
    )
    return replace(rig, friction=friction, hydraulics=hydraulics, sensors=sensors)


def draw_session(
    rig: RigParameters,
    generator: Generator,
    duration_s: float,
    *,
    zeroed: bool,
    residual_offset_pa: float,
    zeros: Array | None = None,
    asymmetry_sd: float = 0.0,
    asymmetry_off: float = 0.0,
) -> Session:
    """Draw one session on this rig.

    Friction varies by about ±5 % from run to run: it has a level for the day and wanders slowly about it. Zeroing the
    transmitters on vented chambers leaves at most the residual offset. Without zeroing, the data sheet allows an offset
    of ±0.5 % of the span and a gain error of ±0.3 %. ``zeros`` are the offsets of both transmitters as shares of these
    limits, ``(2,)``; without them, each session draws its own. The ratio of friction retracting to friction extending
    is off by ``asymmetry_off``, and varies from session to session with the standard deviation ``asymmetry_sd``.
    """
    day = float(np.clip(generator.normal(1.0, 0.03), 0.95, 1.05))
    count = math.ceil(duration_s / DRIFT_STEP_S) + 4
    wander = np.clip(ornstein_uhlenbeck(generator, count, DRIFT_STEP_S, 300.0, 0.015), -0.03, 0.03)
    drawn = generator.uniform(-1.0, 1.0, 2)  # in any case, so that all that follows is the same
    limit_pa = residual_offset_pa if zeroed else 0.005 * 250.0 * BAR_PA
    offset_pa = (drawn if zeros is None else zeros) * limit_pa
    gain = 1.0 + generator.uniform(-1.0, 1.0, 2) * (0.0005 if zeroed else 0.003)
    temperature_c = float(generator.uniform(24.0, 46.0))
    load_offset_n, load_gain = generator.uniform(-1.0, 1.0, 2)
    sensors = replace(
        rig.sensors,
        pressure_offset_pa=tuple(offset_pa.tolist()),
        pressure_gain=tuple(gain.tolist()),
        load_offset_n=7.0 * float(load_offset_n),
        load_gain=1.0 + 0.001 * float(load_gain),
    )
    off, asymmetry = asymmetry_off + asymmetry_sd * float(generator.standard_normal()), rig.friction.asymmetry
    if off:
        ratio = (1.0 + asymmetry) / (1.0 - asymmetry) + off
        asymmetry = (ratio - 1.0) / (ratio + 1.0)
    rig = replace(rig, sensors=sensors, friction=replace(rig.friction, asymmetry=asymmetry))
    return Session(rig, temperature_c, np.asarray(day + wander))


def draw_wide_rig(rig: RigParameters, generator: Generator) -> RigParameters:
    """Draw a rig of this size, with friction, hydraulics and sensors from their whole ranges."""
    return replace(
        rig,
        friction=_wide_friction(rig.friction, rig.hydraulics.mass_kg, generator),
        hydraulics=_wide_hydraulics(rig.hydraulics, generator),
        sensors=_wide_sensors(rig.sensors, generator),
    )


def _log(generator: Generator, low: float, high: float) -> float:
    """Draw a number whose logarithm is uniform."""
    return math.exp(generator.uniform(math.log(low), math.log(high)))


def _wide_friction(default: FrictionParameters, mass_kg: float, generator: Generator) -> FrictionParameters:
    retract_over_extend = generator.uniform(1.05, 1.4)
    seals = _log(generator, 0.4, 2.0)
    stiffness_n_m = _log(generator, 1e6, 1e8)
    viscous_n_s_m = _log(generator, 300.0, 4000.0)
    damping_ratio = generator.uniform(0.3, 1.0)
    critical_n_s_m = 2.0 * math.sqrt(stiffness_n_m * mass_kg)
    share = generator.dirichlet(20.0 * np.array(default.share))
    softness = np.sort(generator.uniform(0.5, 2.0, len(share)) * np.array(default.stiffness_n_m))[::-1]
    return replace(
        default,
        coulomb_n=_log(generator, 115.0, 750.0),
        asymmetry=(retract_over_extend - 1.0) / (retract_over_extend + 1.0),
        coulomb_temperature_1_k=generator.uniform(0.0005, 0.004),
        piston_seal_n=default.piston_seal_n * seals * generator.uniform(0.7, 1.3),
        rod_seal_n=default.rod_seal_n * seals * generator.uniform(0.7, 1.3),
        static_ratio=generator.uniform(1.1, 2.0),
        stribeck_velocity_m_s=_log(generator, 0.002, 0.030),
        film_velocity_m_s=_log(generator, 0.020, 0.100),
        viscous_n_s_m=viscous_n_s_m,
        viscosity_temperature_1_k=generator.uniform(0.025, 0.040),
        stiffness_n_m=tuple((stiffness_n_m * softness / softness.sum()).tolist()),
        share=tuple(share.tolist()),
        attraction_n_s=default.attraction_n_s * _log(generator, 0.5, 2.5),
        damping_n_s_m=min(
            max(damping_ratio * critical_n_s_m - viscous_n_s_m, 0.2 * viscous_n_s_m), CALM_DAMPING * viscous_n_s_m
        ),
        film_build_s=_log(generator, 0.02, 0.15),
        film_squeeze_s=_log(generator, 0.08, 0.5),
        film_dwell_s=_log(generator, 5.0, 40.0),
        ripple=tuple((np.array(default.ripple) * generator.uniform(0.4, 1.8)).tolist()),
        ripple_length_m=tuple((np.array(default.ripple_length_m) * generator.uniform(0.7, 1.4, 3)).tolist()),
        ripple_phase_rad=tuple(generator.uniform(0.0, 2.0 * math.pi, 3).tolist()),
    )


def _wide_hydraulics(default: HydraulicParameters, generator: Generator) -> HydraulicParameters:
    hoses = _log(generator, 0.7, 1.5)
    return replace(
        default,
        dead_volume_1_m3=default.dead_volume_1_m3 * hoses,
        dead_volume_2_m3=default.dead_volume_2_m3 * hoses,
        oil_modulus_pa=generator.uniform(1.2e9, 1.6e9),
        air_fraction=_log(generator, 0.002, 0.010),
        leakage_m3_s_pa=_log(generator, 1e-14, 3e-13),
        pump_flow_m3_s=default.pump_flow_m3_s * generator.uniform(0.7, 1.4),
        pump_pressure_pa=default.pump_pressure_pa * generator.uniform(0.85, 1.3),
        tank_pressure_pa=generator.uniform(0.3e5, 1.5e5),
        valve_gain=default.valve_gain * generator.uniform(0.75, 1.35),
        return_ratio_2=default.return_ratio_2 * generator.uniform(0.75, 1.25),
        valve_overlap=generator.uniform(0.08, 0.15),
        metering_exponent=generator.uniform(1.2, 1.8),
        spool_lag_s=generator.uniform(0.012, 0.030),
    )


def _wide_sensors(default: SensorParameters, generator: Generator) -> SensorParameters:
    first, second = generator.uniform(-1.2e-4, 1.2e-4, 2)
    return replace(
        default,
        anti_alias_hz=generator.uniform(60.0, 90.0),
        pressure_noise_pa=default.pressure_noise_pa * _log(generator, 0.6, 1.8),
        position_noise_m=default.position_noise_m * _log(generator, 0.6, 1.8),
        linearity_m=(float(first), float(second)),
        backlash_m=generator.uniform(0.0, 50e-6),
        temperature_offset_c=generator.uniform(-0.5, 0.5),
    )
