"""The servo rig's numbers, with their units; compiled code takes these tuples as they are. Pressures are gauge.

Nothing is taken over from ``cylinder_friction.rig``: another cylinder, drive, law of friction and sensors. The numbers
are of the order of data sheets of such parts; no particular rig is meant.
"""

from typing import NamedTuple

from cylinder_friction.cylinder import Cylinder

BAR = 1e5
CYLINDER = Cylinder(
    name="servo 40/25 x 300", bore_diameter_m=0.040, rod_diameter_m=0.025, stroke_m=0.300, moving_mass_kg=60.0
)


class Seals(NamedTuple):
    """True friction: two seals and a wiper; ``dynamics`` has the equations."""

    piston_n_bar: float = 3.5  # Boundary friction of the piston seal per bar of its contact pressure [N/bar]
    rod_n_bar: float = 2.8  # The same of the rod seal [N/bar]
    wiper_n: float = 60.0  # Boundary friction of the wiper, which no pressure reaches [N]
    piston_preload_bar: float = 25.0  # Contact pressure without oil pressure [bar]
    rod_preload_bar: float = 20.0  # [bar]
    saturation_bar: float = 300.0  # Oil pressure that raises the contact pressure by half of itself only [bar]
    mixed_share: float = 0.45  # Dry friction that is left once the film is full, over boundary friction [-]
    film_velocity_m_s: float = 0.02  # Half of the rest has gone at this speed, at 40 °C and 50 bar contact [m/s]
    film_lag_s: float = 0.025  # Lag of the film behind the speed [s]
    shear_n: float = 45.0  # Shear of a seal's film at 0.1 m/s, 40 °C and 50 bar contact; grows with roots [N]
    ageing: float = 0.07  # Growth of boundary friction per e-fold of the contacts' age [-]
    ageing_onset_s: float = 0.1  # Age at which that begins [s]
    renewal_m: float = 40e-6  # Travel that renews the contacts [m]
    rod_asymmetry: float = 0.12  # Rod seal: retraction ``1 + a``, extension ``1 - a`` times the mean [-]
    taper: float = 0.10  # Piston seal: relative rise from mid-stroke to the far end of the bore [-]
    barrel: float = -0.05  # Piston seal: relative change from mid-stroke to both ends [-]
    softest_m: float = 3e-4  # Travel at which the last elasto-plastic element yields [m]
    stiffest_m: float = 4e-6  # The same of the first [m]
    reference_n: float = 400.0  # Strength for which those travels hold; elements keep their stiffness [N]
    presliding_n_s_m: float = 250.0  # Damping of the contacts while the film is thin [N s/m]
    wear: float = 1.0  # Factor on all dry friction, drawn for each session [-]


class Drive(NamedTuple):
    """Supply, valve, oil, chambers, load and controller."""

    piston_area_m2: float = CYLINDER.piston_area_m2
    annulus_area_m2: float = CYLINDER.annulus_area_m2
    stroke_m: float = CYLINDER.stroke_m
    mass_kg: float = CYLINDER.moving_mass_kg
    supply_pa: float = 185.0 * BAR  # Constant: an accumulator stands before the valve [Pa]
    tank_pa: float = 4.0 * BAR  # Back pressure of the return line [Pa]
    valve_gain: float = 1.07e-7  # An edge, fully open: 12 l/min at 35 bar [m³/s/√Pa]
    overlap: float = 0.02  # Of each edge, as a share of the travel [-]
    rounding: float = 0.012  # Of the edges, so that some oil passes the closed valve [-]
    spool_hz: float = 80.0  # Natural frequency of the spool [Hz]
    spool_damping: float = 0.8  # Its damping ratio [-]
    laminar_pa: float = 0.2 * BAR  # Orifices turn laminar at this drop [Pa]
    dead_volume_m3: float = 6e-5  # Manifold and port on either side [m³]
    liquid_modulus_pa: float = 1.45e9  # Bulk modulus of the oil itself without pressure [Pa]
    modulus_slope: float = 10.0  # Its growth with pressure [-]
    air_share: float = 0.006  # Free air by volume at atmospheric pressure [-]
    cross_leakage: float = 2e-13  # Past the piston at 40 °C [m³/(s Pa)]
    gravity_n: float = 0.0  # Weight that resists extension [N]
    spring_n_m: float = 0.0  # Spring that resists extension, slack at position 0 [N/m]
    position_gain_1_s: float = 15.0  # Of the position loop [1/s]
    integral_gain_1_s2: float = 0.0  # 0 for a P controller [1/s²]
    extend_m_s: float = 0.33  # Speed that the controller expects of the open valve [m/s]
    retract_m_s: float = 0.26
    oil_c: float = 40.0  # Oil temperature at the beginning [°C]
    warming_c_s: float = 0.0  # [K/s]


class Sensors(NamedTuple):
    """Transmitters, magnetostrictive position, logger."""

    sample_time_s: float = 0.004  # 250 Hz [s]
    pressure_span_pa: float = 400.0 * BAR
    pressure_bits: int = 14
    pressure_noise_pa: float = 0.06 * BAR  # White, root mean square [Pa]
    anti_alias_hz: float = 110.0  # Fourth-order Bessel filter of the pressures; position is sampled as it is [Hz]
    position_bits: int = 16  # Over the stroke
    position_noise_m: float = 4e-6  # White, root mean square [m]
    offset_1_pa: float = 0.0  # Zero of the piston side's transmitter [Pa]
    offset_2_pa: float = 0.0  # Zero of the rod side's [Pa]


GREATEST_OFFSET_PA = 0.15 * BAR  # A transmitter's zero is anywhere within plus and minus this, drawn for each session
