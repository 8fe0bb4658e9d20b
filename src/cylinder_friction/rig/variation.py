"""What differs from rig to rig, and on one rig from session to session."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.rig.integration import DRIFT_STEP_S
from cylinder_friction.rig.lever import ornstein_uhlenbeck
from cylinder_friction.rig.parameters import BAR_PA

if TYPE_CHECKING:
    from numpy.random import Generator
    from numpy.typing import NDArray

    from cylinder_friction.rig.parameters import RigParameters, SensorParameters

PAUSE_S = 300.0
"""Between two recordings of a session."""


@dataclass(frozen=True)
class Session:
    """One stretch of laboratory work with one calibration.

    Attributes:
        rig: The rig as it is that day, throttle set, sensors calibrated.
        oil_temperature_c: At the beginning [°C].
        drift: Slow factor on Coulomb friction through the session, one value each second.
    """

    rig: RigParameters
    oil_temperature_c: float
    drift: NDArray[np.float64]

    def drift_from(self, time_s: float, duration_s: float) -> NDArray[np.float64]:
        """Return the factor for a recording that begins ``time_s`` into the session."""
        first = int(time_s / DRIFT_STEP_S)
        return self.drift[first : first + math.ceil(duration_s / DRIFT_STEP_S) + 2]


def draw_rig(rig: RigParameters, generator: Generator) -> RigParameters:
    """Return one specimen of the rig: its friction, bore, valve and potentiometer within their tolerances."""
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
        # 3 to 5 % in all.
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
        rig.sensors,
        linearity_m=(float(first), float(second)),
        temperature_offset_c=float(generator.uniform(-0.5, 0.5)),
    )
    return replace(rig, friction=friction, hydraulics=hydraulics, sensors=sensors)


def draw_session(
    rig: RigParameters,
    generator: Generator,
    duration_s: float,
    *,
    zeroed: bool,
    residual_offset_pa: float,
) -> Session:
    """Return one session on this rig.

    Friction keeps within about ±5 % from run to run: a level for the day and a slow wander about it.

    Args:
        rig: One specimen, with the throttle set.
        generator: Of this session.
        duration_s: How long the session lasts, for the drift [s].
        zeroed: Whether the transmitters were zeroed on vented chambers. If not, their data sheet's ±0.5 % of the span
            stays in the offset and ±0.3 % in the gain.
        residual_offset_pa: Largest offset that zeroing leaves [Pa].
    """
    day = float(np.clip(generator.normal(1.0, 0.03), 0.95, 1.05))
    count = math.ceil(duration_s / DRIFT_STEP_S) + 4
    wander = np.clip(ornstein_uhlenbeck(generator, count, DRIFT_STEP_S, 300.0, 0.015), -0.03, 0.03)
    sensors = _calibrated(rig.sensors, generator, zeroed, residual_offset_pa)
    temperature_c = float(generator.uniform(24.0, 46.0))
    load_offset_n, load_gain = generator.uniform(-1.0, 1.0, 2)
    sensors = replace(sensors, load_offset_n=7.0 * float(load_offset_n), load_gain=1.0 + 0.001 * float(load_gain))
    return Session(replace(rig, sensors=sensors), temperature_c, np.asarray(day + wander))


def _calibrated(
    sensors: SensorParameters, generator: Generator, zeroed: bool, residual_offset_pa: float
) -> SensorParameters:
    offset = generator.uniform(-1.0, 1.0, 2) * (residual_offset_pa if zeroed else 0.005 * 250.0 * BAR_PA)
    gain = 1.0 + generator.uniform(-1.0, 1.0, 2) * (0.0005 if zeroed else 0.003)
    return replace(
        sensors,
        pressure_offset_pa=(float(offset[0]), float(offset[1])),
        pressure_gain=(float(gain[0]), float(gain[1])),
    )
