"""Parameters of the simulated rig, each with its unit and the origin of its value.

All pressures are gauge. ``friction_constants`` and ``hydraulic_constants`` convert parameters to named tuples for
compiled code.
"""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Collection
from dataclasses import dataclass, field, fields, replace
from typing import Any

from cylinder_friction.cylinder import Cylinder

BAR_PA = 1e5
DEFAULT_STEP_S = 5e-5  # Step of the integration [s]
ELEMENTS = 4
"""Maxwell-slip elements of the true friction; four to ten describe presliding well (Al-Bender et al., 2005)."""


@dataclass(frozen=True)
class FrictionParameters:
    """The true friction of the rig: generalised Maxwell-slip, lubricant film, seal pressure, temperature, bore ripple.

    It has more effects than any model in this package, so that no estimator can be right by construction. Defaults are
    of a 63 mm cylinder with elastomer seals; scale the forces yourself for another size.
    """

    coulomb_n: float = 235.0  # Coulomb friction without pressure at 40 °C, mean of both directions [N]
    # Friction is ``1 + asymmetry`` times the mean in retraction and ``1 - asymmetry`` times in extension
    asymmetry: float = 0.0943
    coulomb_temperature_1_k: float = 0.002  # Relative fall of ``coulomb_n`` with temperature [1/K]
    piston_seal_n: float = 9.0  # Friction at 1 bar of the higher pressure, growing with its power 0.8 [N]
    rod_seal_n: float = 8.0  # Friction of a rod's seal at 1 bar, growing with its power 0.7 [N]
    rod_on_side_1: bool = False  # Whether side 1 has a rod too; ``default_rig`` sets it
    static_ratio: float = 1.5  # Breakaway over Coulomb friction after a long dwell [-]
    # Decay of the Stribeck curve at 40 °C [m/s]; grows as viscosity falls (Hersey)
    stribeck_velocity_m_s: float = 0.008
    film_velocity_m_s: float = 0.04  # Speed of a full film, with the least steady friction, at 40 °C [m/s]
    viscous_n_s_m: float = 1500.0  # Viscous coefficient at 40 °C [N s/m]
    viscosity_temperature_1_k: float = 0.033  # Exponential fall of the oil's viscosity [1/K]
    # Presliding stiffness of each element [N/m]
    stiffness_n_m: tuple[float, float, float, float] = (2.2e6, 1.4e6, 0.9e6, 0.5e6)
    # Share of each element in the strength; they sum to 1
    share: tuple[float, float, float, float] = (0.15, 0.20, 0.30, 0.35)
    attraction_n_s: float = 6e4  # Rate at which a slipping element approaches its strength, the frictional lag [N/s]
    # Presliding damping [N s/m]. As it fades with speed, it drives the motion with up to 0.45 of this value. The
    # viscous coefficient of warm oil must exceed that, or the rig chatters at the oil's resonance
    damping_n_s_m: float = 2000.0
    damping_velocity_m_s: float = 0.002  # Speed above which the presliding damping fades [m/s]
    film_build_s: float = 0.05  # Time constant of the film as it builds [s]
    film_squeeze_s: float = 0.2  # Time constant of the film as it thins in motion [s]
    film_dwell_s: float = 15.0  # Time constant of the film as it thins at rest; makes breakaway depend on the dwell [s]
    dwell_velocity_m_s: float = 5e-4  # Speed between rest and motion, for the two time constants above [m/s]
    ripple: tuple[float, float, float] = (0.02, 0.012, 0.008)  # Relative amplitude of each wave of the bore ripple [-]
    ripple_length_m: tuple[float, float, float] = (0.19, 0.061, 0.023)  # Length of each wave [m]
    ripple_phase_rad: tuple[float, float, float] = (0.4, 2.1, 4.4)  # Phase of each wave [rad]
    bend_n_per_n: float = 0.0  # Relative friction of a bent rod at full stroke; 0 when straight [-]
    ageing: float = 0.0  # Growth of dry friction per e-fold of the contacts' age [-]
    ageing_onset_s: float = 0.1  # Age at which that growth begins [s]
    renewal_m: float = 0.002  # Travel that renews the contacts [m]


@dataclass(frozen=True)
class HydraulicParameters:
    """Cylinder chambers, supply, valve, throttle, cushions, stops and oil of the rig.

    Pressures are gauge [Pa], flows in m³/s, and gains of orifices in m³/s/√Pa. Make it by ``default_rig``, which
    derives areas, volumes and flows from the cylinder, and change single values by ``dataclasses.replace``.
    """

    piston_area_m2: float  # Piston area A1 [m²]; ``default_rig`` sets it and the next three from the cylinder
    annulus_area_m2: float  # Annulus area A2 [m²]
    stroke_m: float  # Stroke [m]
    mass_kg: float  # Moving mass [kg]
    dead_volume_1_m3: float = 1.2e-4  # Oil on the piston side at position 0, hose included [m³]
    dead_volume_2_m3: float = 1.2e-4  # Oil on the rod side at full stroke, hose included [m³]
    oil_modulus_pa: float = 1.4e9  # Bulk modulus of oil without air [Pa]
    air_fraction: float = 0.005  # Undissolved air by volume at atmospheric pressure [-]
    polytropic_exponent: float = 1.4  # Polytropic exponent of the air [-]
    atmosphere_pa: float = 101_325.0  # Absolute pressure of the surroundings [Pa]
    leakage_m3_s_pa: float = 1e-13  # Leakage past the piston seal at 40 °C [m³/(s Pa)]; healthy: 1e-14 to 1e-13
    pump_flow_m3_s: float = 10.0 / 60e3  # Largest flow of the pump [m³/s]
    pump_pressure_pa: float = 60e5  # Pressure at which the compensator has closed the pump [Pa]
    compensator_band_pa: float = 3e5  # Pressure range over which the compensator closes [Pa]
    relief_factor: float = 1.08  # Relief valve opens at this multiple of ``pump_pressure_pa`` [-]
    relief_gain_m3_s_pa: float = 5e-10  # Flow of the relief valve per pressure above its opening [m³/(s Pa)]
    supply_volume_m3: float = 1e-3  # Oil between pump and valve [m³]
    tank_pressure_pa: float = 0.5e5  # Back pressure of the return filter [Pa]
    valve_gain: float = 4e-7  # Gain of the fully open supply edges [m³/s/√Pa]
    # Opening of the return edge of port A over that of the supply edges [-]; spools for single-rod cylinders open it
    # wide, so that the larger flow from the piston side causes little back pressure
    return_ratio_1: float = 4.0
    return_ratio_2: float = 2.0  # The same ratio for port B [-]
    valve_overlap: float = 0.11  # Dead band of the closed centre, as a part of the travel [-]; 0.08 to 0.15
    metering_exponent: float = 1.5  # Shape of the metering notches: opening = travel to this power [-]
    spool_lag_s: float = 0.02  # First-order lag from lever to spool [s]
    # Gain of the meter-out throttle on port B, for outflow only [m³/s/√Pa]; inflow passes its check valve
    throttle_gain: float = 2e-6
    check_gain: float = 2e-6  # Gain of that check valve [m³/s/√Pa]
    # Gain of the anti-cavitation valves from the tank into each chamber [m³/s/√Pa]; 0 if no load pulls
    makeup_gain: float = 0.0
    makeup_cracking_pa: float = 0.2e5  # Pressure below the tank's at which these valves open [Pa]
    laminar_pressure_pa: float = 0.3e5  # Pressure drop below which an orifice is laminar [Pa]
    cushion_length_m: float = 0.02  # Length of the cushion at each end [m]
    cushion_open_gain: float = 1e-6  # Gain of the throttle at the start of the cushion [m³/s/√Pa]
    cushion_closed_gain: float = 1e-8  # Gain that remains at the end of the stroke [m³/s/√Pa]
    stop_stiffness_n_m: float = 1e8  # Stiffness of an end stop [N/m]
    # Damping of an end stop relative to its spring force, per velocity (Hunt and Crossley, 1975) [s/m]
    stop_damping_s_m: float = 5.0
    oil_heat_capacity_j_k: float = 6.6e4  # Heat capacity of the oil in the tank [J/K]
    cooling_w_k: float = 8.0  # Heat flow from the tank to the room per difference of temperature [W/K]
    room_temperature_c: float = 21.0


@dataclass(frozen=True)
class SensorParameters:
    """Two pressure transmitters, a potentiometer, a Pt100 in the oil, a load cell if there is a load, the logger.

    Noise, offsets, gains, hysteresis and resolution come from the data sheets. Set noise and offsets to zero to see
    how an estimator performs with perfect sensors.
    """

    sample_time_s: float = 0.005  # Sample time of the logger [s]
    jitter_s: float = 0.0  # By how much the logger takes a sample too early or late, as its stamps state [s]
    pressure_span_pa: float = 250e5  # Range of the transmitters [Pa]
    position_span_m: float = 0.25  # Range of the potentiometer [m]
    bits: int = 12  # Resolution of the converter, over each span
    # Step of a digital position sensor, in place of the converter's; 0 if it is analogue [m]
    position_step_m: float = 0.0
    anti_alias_hz: float = 80.0  # Corner of the second-order filter before the converter [Hz]
    pressure_noise_pa: float = 0.05e5  # Root mean square of the pressure noise [Pa]
    position_noise_m: float = 30e-6  # Root mean square of the position noise [m]
    pressure_offset_pa: tuple[float, float] = (0.0, 0.0)  # Offset of each transmitter [Pa]
    pressure_gain: tuple[float, float] = (1.0, 1.0)  # Gain of each transmitter, 1 when calibrated [-]
    pressure_drift_pa_s: tuple[float, float] = (0.0, 0.0)  # Drift of each offset [Pa/s]
    pressure_lag_s: float = 0.0  # First-order lag of each transmitter [s]
    # Pressure loss of the line between each transmitter and its chamber, per flow [Pa s/m³] and per squared flow
    # [Pa s²/m⁶]; 0 if the transmitters are at the cylinder
    line_laminar_pa_s_m3: float = 0.0
    line_turbulent_pa_s2_m6: float = 0.0
    linearity_m: tuple[float, float] = (0.0, 0.0)  # Two half-wave amplitudes of the potentiometer's linearity error [m]
    backlash_m: float = 20e-6  # Backlash of the potentiometer's coupling [m]
    temperature_span_c: float = 100.0  # Range of the Pt100's transmitter, from 0 °C [K]
    temperature_noise_c: float = 0.05  # Root mean square of the temperature noise [K]
    temperature_offset_c: float = 0.0  # Offset of the Pt100 [K]; class B of IEC 60751 allows ±0.5 K at 40 °C
    temperature_lag_s: float = 8.0  # Time constant of the thermometer in its well [s]
    load_span_n: float = 5000.0  # Range of the load cell in each direction [N]
    load_noise_n: float = 2.0  # Root mean square of the load cell's noise [N]
    load_offset_n: float = 0.0  # Offset that taring leaves [N]; with the gain, within ±0.1 % of both ranges
    load_gain: float = 1.0  # Gain of the load cell, 1 when calibrated [-]
    load_delay_s: float = 0.0  # Delay of the load cell's amplifier, a digital filter [s]


@dataclass(frozen=True)
class RigParameters:
    """The whole rig: cylinder, hydraulics, true friction and sensors.

    ``default_rig`` makes the healthy one. Pass a changed copy to ``simulate`` to study other seals, valves or sensors;
    ``with_fault`` in ``rig.faults`` makes a rig with a defect of stated severity.
    """

    cylinder: Cylinder
    hydraulics: HydraulicParameters
    friction: FrictionParameters = field(default_factory=FrictionParameters)
    sensors: SensorParameters = field(default_factory=SensorParameters)

    def with_throttle(self, gain: float) -> RigParameters:
        """Build the rig with another setting of the meter-out throttle [m³/s/√Pa]."""
        return replace(self, hydraulics=replace(self.hydraulics, throttle_gain=gain))


THROTTLE_GAINS = {"1": 2e-6, "2": 5.5e-8, "3": 3.2e-8, "4": 2.2e-8}
"""The four settings of the meter-out throttle [m³/s/√Pa]: no load, then three growing loads on extension."""

PUMP_FLOWS_M3_S = {"didactic": 3.0 / 60e3, "industrial": 10.0 / 60e3}
"""Largest pump flow of each supply: a didactic unit gives 16 mm/s in extension, a small industrial one 53 mm/s."""


def default_rig(cylinder: Cylinder, supply: str = "industrial") -> RigParameters:
    """Build the healthy rig with this cylinder and supply, the throttle wide open.

    Start here to simulate a bench of your own size, and change single parameters by ``dataclasses.replace``. Areas,
    stroke and mass come from the cylinder; friction and valve stay those of a 63 mm bore. Pressures are gauge [Pa].

    Raises:
        ValueError: The supply is not known.
    """
    refuse_unknown("supply", supply, PUMP_FLOWS_M3_S)
    hydraulics = HydraulicParameters(
        piston_area_m2=cylinder.piston_area_m2,
        annulus_area_m2=cylinder.annulus_area_m2,
        stroke_m=cylinder.stroke_m,
        mass_kg=cylinder.moving_mass_kg,
        pump_flow_m3_s=PUMP_FLOWS_M3_S[supply],
    )
    friction = FrictionParameters(rod_on_side_1=cylinder.rod_diameter_1_m > 0.0)
    return RigParameters(cylinder, hydraulics, friction, SensorParameters(position_span_m=cylinder.stroke_m))


def refuse_unknown(key: str, name: str, known: Collection[str]) -> None:
    """Raise ``ValueError`` unless ``name``, the value of the parameter ``record.<key>``, is one of the known ones."""
    if name not in known:
        raise ValueError(f"record.{key}: got {name!r}, but expected one of {sorted(known)}")


def _tuple_class(name: str, parameters: type) -> Any:
    """Make a class of named tuples with the parameters' fields, since compiled code takes no dataclass."""
    return namedtuple(name, [entry.name for entry in fields(parameters)], module=__name__)


FrictionConstants = _tuple_class("FrictionConstants", FrictionParameters)
HydraulicConstants = _tuple_class("HydraulicConstants", HydraulicParameters)


def friction_constants(parameters: FrictionParameters) -> Any:
    """Convert the parameters to the named tuple that compiled code takes: same names, numbers only."""
    return FrictionConstants(**vars(parameters))


def hydraulic_constants(parameters: HydraulicParameters) -> Any:
    """Convert the parameters to the named tuple that compiled code takes: same names, numbers only."""
    return HydraulicConstants(*map(float, vars(parameters).values()))
