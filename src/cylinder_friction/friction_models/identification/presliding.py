"""Bristle stiffness from reversals, and bristle damping from a damping ratio."""

import math
from collections.abc import Sequence

import numpy as np

from cylinder_friction.friction_models.lugre import passive_damping_velocity
from cylinder_friction.friction_models.parameters import STIFFNESS_RANGE_N_M
from cylinder_friction.recordings.recording import Recording

_LONGEST_REVERSAL_S = 0.3
_PASSIVE_MARGIN = 0.9


def bristle_stiffness(recordings: Sequence[Recording], coulomb_n: float, slowest_m_s: float) -> float:
    """Measure the median rise of friction over travel, dF/dx, in the reversals of labelled recordings [N/m].

    At a reversal, friction rises almost linearly with travel until the bristles slip. With a few hundred samples per
    second and a position resolution of tens of micrometres, the result only starts the search. Without a clean
    reversal, the result is ``coulomb_n`` over 50 micrometres.
    Rises are measured while friction is below 0.8 ``coulomb_n``; rows slower than ``slowest_m_s`` are at standstill.
    """
    slopes = [slope for recording in recordings for slope in _reversal_slopes(recording, 0.8 * coulomb_n, slowest_m_s)]
    stiffness = float(np.median(slopes)) if slopes else coulomb_n / 50e-6
    return min(max(stiffness, STIFFNESS_RANGE_N_M[0]), STIFFNESS_RANGE_N_M[1])


def _reversal_slopes(recording: Recording, level_n: float, slowest_m_s: float) -> list[float]:
    velocity, friction = recording.column("velocity_m_s"), recording.column("friction_n")
    usable = recording.usable()
    travel = np.cumsum(velocity) * recording.sample_time_s
    sliding = np.flatnonzero(np.abs(velocity) >= slowest_m_s)
    turns = np.flatnonzero(np.sign(velocity[sliding[1:]]) != np.sign(velocity[sliding[:-1]]))
    longest = round(_LONGEST_REVERSAL_S / recording.sample_time_s)
    slopes = []
    for turn in turns:
        last, first = int(sliding[turn]), int(sliding[turn + 1])
        if first - last > longest or not usable[last : first + longest].all():
            continue
        rows = last + np.flatnonzero(np.abs(friction[last : first + longest // 4]) < level_n)
        if len(rows) < 2:
            continue
        rise_n, path_m = friction[rows[-1]] - friction[rows[0]], travel[rows[-1]] - travel[rows[0]]
        if rise_n * path_m > 0.0 and abs(rise_n) > 0.5 * level_n:
            slopes.append(float(rise_n / path_m))
    return slopes


def bristle_damping(damping_ratio: float, bristle_stiffness_n_m: float, mass_kg: float, viscous_n_s_m: float) -> float:
    """Compute the bristle damping with which the mass on its bristles has this damping ratio [N s/m].

    Source: Canudas de Wit et al. 1995, section III: ``2 zeta sqrt(s0 m) - s2``, here at least 0.
    """
    return max(2.0 * damping_ratio * math.sqrt(bristle_stiffness_n_m * mass_kg) - viscous_n_s_m, 0.0)


def damping_velocity(stribeck_velocity_m_s: float, least_dry_friction_n: float, bristle_damping_n_s_m: float) -> float:
    """Compute the speed over which bristle damping fades [m/s]: the Stribeck velocity or, for passivity, less."""
    limit = passive_damping_velocity(least_dry_friction_n, bristle_damping_n_s_m)
    return min(stribeck_velocity_m_s, _PASSIVE_MARGIN * limit)
