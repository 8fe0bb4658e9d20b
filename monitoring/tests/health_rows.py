"""Sessions of a cylinder whose friction, oil and sensors are drawn, for tests of monitoring."""

from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np

from cylinder_friction_monitoring.trends.session_row import Indicator, SessionRow

START = datetime(2025, 1, 1, 6, tzinfo=UTC)
LEVELS = {"friction_n": 400.0, "breakaway_n": 440.0, "half_sum_n": -40.0, "leak_m3_s_pa": 6e-14, "profile_n": 12.0}
SCATTERS = {"friction_n": 0.02, "breakaway_n": 0.03, "leak_m3_s_pa": 0.3, "profile_n": 0.15}
"""As shares of the level; the half sum scatters by 10 N."""


def sessions(count: int, seed: int = 0, per_kelvin: float = -0.003) -> list[SessionRow]:
    """Return sessions, one a day, of a healthy cylinder whose friction falls as its oil warms."""
    generator = np.random.default_rng(seed)
    rows = []
    for day in range(count):
        oil_c = float(40.0 + 4.0 * np.sin(day / 20.0) + generator.normal(0.0, 2.0))
        warm = 1.0 + per_kelvin * (oil_c - 40.0)
        values = {
            name: level * (warm if name in ("friction_n", "breakaway_n") else 1.0)
            * (1.0 + SCATTERS.get(name, 0.0) * float(generator.normal()))
            for name, level in LEVELS.items()
        }  # fmt: skip
        values["half_sum_n"] += 10.0 * float(generator.normal())
        indicators = {name: Indicator(value, 0.01 * abs(value)) for name, value in values.items()}
        covariates = {
            "oil_temperature_c": oil_c,
            "pressure_1_bar": float(20.0 + generator.normal(0.0, 0.5)),
            "pressure_2_bar": float(22.0 + generator.normal(0.0, 0.5)),
            "speed_m_s": float(0.03 + generator.normal(0.0, 0.001)),
            "load_n": None,
            "travel_m": 2.0,
        }
        start = f"{START + timedelta(days=day):%Y-%m-%dT%H:%M:%SZ}"
        indicators["viscous_n_s_m"] = Indicator(None, why="one speed")
        rows.append(SessionRow("press", f"s{day:03d}", start, "test", 60.0, indicators, covariates))
    return rows


def changed(
    rows: list[SessionRow],
    first: int,
    within: int = 1,
    add: Mapping[str, float] | None = None,
    times: Mapping[str, float] | None = None,
    beside: Mapping[str, float] | None = None,
) -> list[SessionRow]:
    """Return rows whose indicators, and covariates ``beside``, change from session ``first`` on."""
    found = []
    for day, row in enumerate(rows):
        part = min(max((day - first + 1) / within, 0.0), 1.0)
        own = dict(row.indicators)
        for name in {**(times or {}), **(add or {})}:
            factor, more = 1.0 + ((times or {}).get(name, 1.0) - 1.0) * part, (add or {}).get(name, 0.0) * part
            value = own[name].value
            own[name] = replace(own[name], value=None if value is None else value * factor + more)
        covariates = {
            name: None if value is None else value + part * (beside or {}).get(name, 0.0)
            for name, value in row.covariates.items()
        }
        found.append(replace(row, indicators=own, covariates=covariates))
    return found
