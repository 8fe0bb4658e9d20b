"""Every friction model keeps the product's contract of friction models."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from cylinder_friction.testing.friction_model_contract import CHECKS, FrictionModelCase
from friction_benchmark.friction_models import FRICTION_MODELS
from friction_benchmark.friction_models.film_lugre import FilmLugreParameters
from model_samples import ODD


def on_full_film(numbers: FilmLugreParameters, speed_m_s: float) -> float:
    """Return dry friction of steady sliding on the film that the speed builds [N]."""
    full = 1.0 - numbers.coulomb_n / numbers.static_n
    film = full * min(speed_m_s / numbers.film_velocity_m_s, 1.0) ** (2.0 / 3.0)
    fall = np.exp(-((speed_m_s / numbers.stribeck_velocity_m_s) ** numbers.stribeck_exponent))
    return float(numbers.coulomb_n + ((1.0 - film) * numbers.static_n - numbers.coulomb_n) * fall)


def test_every_model_is_under_contract() -> None:
    assert set(FRICTION_MODELS) == {*ODD, *(f"pressure_{name}" for name in ODD)}
    assert all(FRICTION_MODELS[name].name == name for name in FRICTION_MODELS)


@pytest.mark.parametrize("name", sorted(ODD))
def test_contract(name: str) -> None:
    numbers = ODD[name]
    steady_n = partial(on_full_film, numbers) if isinstance(numbers, FilmLugreParameters) else None
    for check in CHECKS:
        check(FrictionModelCase(type(FRICTION_MODELS[name]), numbers, steady_n))
