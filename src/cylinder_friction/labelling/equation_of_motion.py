"""Friction from the piston's equation of motion.

One signed equation holds for both directions, with gauge pressures, extension positive and friction positive when it
opposes extension:

    friction = P1·A1 - P2·A2 - m·a - F_load                                                                 (mode none)

If a drive force was measured instead of the pressures, it replaces P1·A1 - P2·A2.

The measured pressures already contain the whole action of the oil on the piston, including its compressibility. The
equation therefore has no term for the oil's stiffness. Three further modes exist, each for its own reason:

``trapped_oil``
    For closed ports without measured pressures: the oil's spring *replaces* the pressure term,
    P1·A1 - P2·A2 ≈ -K_h·(x - x_ref), K_h = β·(A1²/V1 + A2²/V2). The volumes V1 and V2 of the chambers are those at
    x_ref, the position at which the two pressures balance.

``external``
    A real spring between rod and frame: k·(x - x_ref) is subtracted in addition to the load.

``paper_literal``
    Equations (3) and (4) of Jamshidi et al. as printed: K_eq·x is added to the measured pressures, with
    K_eq = β·A1/L1 + β·A2/L2 (both springs act on the piston, so they add) and the lengths L of the oil columns. This
    counts the oil's force twice, and x has no physical zero: at mid-stroke, K_eq·x is millions of newtons while
    friction is hundreds. In retraction, (4) also keeps the signs that inertia and spring have in extension. The mode
    only demonstrates these errors; percentages of such a label mean nothing. At standstill, for which neither equation
    is defined, the last direction holds.
"""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.recordings.columns import DRIVE_FORCE
from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.signals.motion import last_direction
from cylinder_friction.signals.smooth_signals import SmoothDrive, SmoothSignals

StiffnessMode = Literal["none", "trapped_oil", "external", "paper_literal"]


@dataclass(frozen=True)
class Stiffness:
    """Which spring, if any, enters the equation of motion; the module's docstring explains each mode.

    Raises:
        ValueError: The mode is not known.
    """

    mode: StiffnessMode = "none"
    bulk_modulus_pa: float = 1.4e9  # Bulk modulus β of the oil [Pa]; for ``trapped_oil`` and ``paper_literal``
    external_stiffness_n_m: float = 0.0  # Stiffness k of the spring between rod and frame [N/m]; for ``external``
    # Position x_ref at which the spring exerts no force [m]; for ``trapped_oil`` and ``external``
    reference_m: float = 0.125
    dead_volume_m3: float = 1.2e-4  # Oil in each chamber that the piston cannot displace [m³]; for both oil springs

    def __post_init__(self) -> None:
        if self.mode not in get_args(StiffnessMode):
            raise ValueError(f"stiffness must be one of {', '.join(get_args(StiffnessMode))}, but got {self.mode!r}")


def friction_label(
    signals: SmoothSignals | SmoothDrive,
    position_m: Array,
    load_force_n: Array | float,
    cylinder: Cylinder,
    stiffness: Stiffness,
) -> Array:
    """Compute friction [N], shape ``(n,)``, positive when it opposes positive velocity.

    A positive load resists extension; without a load, pass 0.

    Raises:
        RecordingError: The mode has a spring of oil, but a drive force was measured instead of the pressures.
    """
    force_n = drive_force(signals, cylinder)
    inertia = cylinder.moving_mass_kg * signals.acceleration_m_s2
    if stiffness.mode in ("trapped_oil", "paper_literal") and isinstance(signals, SmoothDrive):
        raise RecordingError(
            f"label.stiffness is {stiffness.mode}, the spring of oil beside or in place of pressures, but the "
            f"recording has {DRIVE_FORCE} and no pressures; set label.stiffness to none or, for a real spring, external"
        )
    if stiffness.mode == "trapped_oil":
        force_n = -trapped_oil_stiffness(cylinder, stiffness) * (position_m - stiffness.reference_m)
    if stiffness.mode == "external":
        force_n = force_n - stiffness.external_stiffness_n_m * (position_m - stiffness.reference_m)
    if stiffness.mode == "paper_literal":
        spring = paper_stiffness(position_m, cylinder, stiffness) * position_m
        direction = last_direction(signals.velocity_m_s)
        # (3) and (4) give an unsigned force; the direction gives it its sign.
        unsigned = direction * (force_n - load_force_n) - spring - inertia
        return direction * unsigned
    return force_n - inertia - load_force_n


def drive_force(signals: SmoothSignals | SmoothDrive, cylinder: Cylinder) -> Array:
    """Compute the force that drives the piston [N], shape ``(n,)``: P1·A1 - P2·A2 or the measured drive force."""
    if isinstance(signals, SmoothDrive):
        return signals.drive_force_smooth_n
    return (
        signals.pressure_1_smooth_pa * cylinder.piston_area_m2 - signals.pressure_2_smooth_pa * cylinder.annulus_area_m2
    )


def trapped_oil_stiffness(cylinder: Cylinder, stiffness: Stiffness) -> float:
    """Compute K_h = β·(A1²/V1 + A2²/V2) [N/m] with the volumes at the reference position."""
    area_1, area_2 = cylinder.piston_area_m2, cylinder.annulus_area_m2
    volume_1 = stiffness.dead_volume_m3 + area_1 * stiffness.reference_m
    volume_2 = stiffness.dead_volume_m3 + area_2 * (cylinder.stroke_m - stiffness.reference_m)
    return stiffness.bulk_modulus_pa * (area_1**2 / volume_1 + area_2**2 / volume_2)


def paper_stiffness(position_m: Array, cylinder: Cylinder, stiffness: Stiffness) -> Array:
    """Compute K_eq = β·A1/L1 + β·A2/L2 [N/m], shape ``(n,)``: the sum of equations (1) and (2).

    The dead volume lengthens each oil column. Without it, the stiffness would be infinite at the ends of the stroke.
    """
    area_1, area_2 = cylinder.piston_area_m2, cylinder.annulus_area_m2
    inside = np.clip(position_m, 0.0, cylinder.stroke_m)
    length_1 = inside + stiffness.dead_volume_m3 / area_1
    length_2 = cylinder.stroke_m - inside + stiffness.dead_volume_m3 / area_2
    return stiffness.bulk_modulus_pa * (area_1 / length_1 + area_2 / length_2)
