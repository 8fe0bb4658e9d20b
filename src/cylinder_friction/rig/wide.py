"""Any rig of this size: friction from the whole range of 63/28 cylinders, oil, valve and sensors moderately varied.

For "a rig that nobody has seen", and for teaching by many rigs. The ranges are design values that hold what is known
of seals of this size: breakaway of 0.5 to 3 bar on the piston, Stribeck velocities of 2 to 30 mm/s, presliding
stiffness of 1 to 100 N/µm, damping ratios of 0.3 to 1. Cylinder, stroke and moving mass stay: they are known.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.random import Generator

    from cylinder_friction.rig.parameters import (
        FrictionParameters,
        HydraulicParameters,
        RigParameters,
        SensorParameters,
    )

CALM_DAMPING = 1.3
"""Presliding damping over viscous damping at most; the default rig has 1.33. With more, warm oil no longer outweighs
what the fading presliding damping drives, and the rig chatters at the oil's resonance."""


def draw_wide_rig(rig: RigParameters, generator: Generator) -> RigParameters:
    """Return a rig of this size whose friction, hydraulics and sensors are drawn from their whole ranges.

    Args:
        rig: The default rig; its cylinder and supply stay.
        generator: Of the specimen.
    """
    return replace(
        rig,
        friction=_friction(rig.friction, rig.hydraulics.mass_kg, generator),
        hydraulics=_hydraulics(rig.hydraulics, generator),
        sensors=_sensors(rig.sensors, generator),
    )


def _log(generator: Generator, low: float, high: float) -> float:
    """Return a number whose logarithm is uniform."""
    return math.exp(generator.uniform(math.log(low), math.log(high)))


def _friction(default: FrictionParameters, mass_kg: float, generator: Generator) -> FrictionParameters:
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


def _hydraulics(default: HydraulicParameters, generator: Generator) -> HydraulicParameters:
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


def _sensors(default: SensorParameters, generator: Generator) -> SensorParameters:
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
