"""One physical set of numbers for each friction model."""

from __future__ import annotations

from typing import TYPE_CHECKING

from friction_samples import CURVE, PLAIN_LUGRE, held_path

from friction_benchmark.friction_models.coulomb_stribeck import CoulombStribeckParameters
from friction_benchmark.friction_models.dahl import DahlParameters
from friction_benchmark.friction_models.film_lugre import FilmLugreParameters
from friction_benchmark.friction_models.maxwell_slip import MaxwellSlipParameters

if TYPE_CHECKING:
    from cylinder_friction.friction_models.parameters import ModelParameters

__all__ = ["ODD", "held_path"]

ODD: dict[str, ModelParameters] = {
    "stribeck": CoulombStribeckParameters(
        **CURVE, viscous_n_s_m=1500.0, regularising_velocity_m_s=5e-4, standstill_share=0.6
    ),
    "dahl": DahlParameters(240.0, 1500.0, 5e6),
    "lugre": PLAIN_LUGRE,
    "film_lugre": FilmLugreParameters(
        **CURVE,
        viscous_n_s_m=1500.0,
        bristle_stiffness_n_m=5e6,
        bristle_damping_n_s_m=4000.0,
        damping_velocity_m_s=8e-3,
        film_velocity_m_s=0.04,
        film_build_s=0.05,
        film_squeeze_s=0.2,
        film_dwell_s=2.0,
        film_inertia_s=2e-3,
    ),
    "gms": MaxwellSlipParameters(
        **CURVE,
        viscous_n_s_m=1500.0,
        bristle_stiffness_n_m=5e6,
        travel_spread=20.0,
        share_tilt=0.5,
        attraction_n_s=8000.0,
    ),
}
"""Without pressure or direction."""
