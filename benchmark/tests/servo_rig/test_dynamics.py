"""Physics of the servo rig: balances, continuity, the law of friction, and the step of the integration."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numba
import numpy as np
import pytest

import friction_benchmark.servo_rig as package
from friction_benchmark.servo_rig.dynamics import (
    ELEMENTS,
    bulk_modulus,
    damping,
    edge,
    element_shares,
    opening,
    strengths,
    stretch,
    viscosity_ratio,
)
from friction_benchmark.servo_rig.parameters import BAR, Drive, Seals
from friction_benchmark.servo_rig.simulate import simulate

if TYPE_CHECKING:
    import pandas as pd

DT = 1e-3
SEALS, DRIVE = Seals(), Drive()
VERTICAL = DRIVE._replace(gravity_n=588.6, spring_n_m=1500.0)


def sine(seconds: float, amplitude_m: float = 0.04, hertz: float = 0.5) -> np.ndarray:
    time_s = DT * np.arange(round(seconds / DT) + 1)
    begun = np.minimum(time_s, 1.0) ** 2
    return 0.15 + amplitude_m * begun * np.sin(2.0 * np.pi * hertz * time_s)


def drive_force_n(trace: pd.DataFrame) -> np.ndarray:
    force = trace["pressure_1_pa"] * DRIVE.piston_area_m2 - trace["pressure_2_pa"] * DRIVE.annulus_area_m2
    return np.asarray(force - trace["load_force_n"])


@numba.njit
def friction_of_motion(
    seals: Any, velocity_m_s: Any, p1: float, p2: float, oil_c: float, place: float, age_s: float, dt: float
) -> Any:
    """Return friction [N], one value per velocity, at constant pressures: the friction law alone, without the rig."""
    share, stiffness = element_shares(seals)
    force, found = np.zeros(ELEMENTS), np.empty(len(velocity_m_s))
    viscosity, film = viscosity_ratio(oil_c), 0.0
    for k in range(len(velocity_m_s)):
        v = velocity_m_s[k]
        film += (abs(v) - film) * dt / (seals.film_lag_s + dt)
        age_s = (age_s + dt) / (1.0 + dt * abs(v) / seals.renewal_m)
        extend_n, retract_n, chi = strengths(seals, p1, p2, place, film, age_s, viscosity)
        stretch(force, share, stiffness, dt * v, extend_n, retract_n)
        found[k] = force.sum() + damping(seals, p1, p2, abs(v), chi, viscosity) * v
    return found


def breakaway_n(rest_s: float) -> float:
    """Return the peak of friction after a rest, at a slow start, once the contacts have been renewed."""
    slide, rest = np.full(2000, 0.02), np.zeros(round(rest_s / DT))
    start = np.minimum(0.02 * DT * np.arange(3000), 0.02)
    force = friction_of_motion(SEALS, np.concatenate([slide, rest, start]), 50e5, 80e5, 40.0, 0.0, 0.0, DT)
    return float(force[len(slide) + len(rest) :].max())


@pytest.mark.parametrize("drive", [DRIVE, VERTICAL], ids=["horizontal", "vertical"])
def test_at_rest_oil_load_and_friction_are_in_balance(drive: Drive) -> None:
    trace = simulate(SEALS, drive, np.full(6001, 0.12)).iloc[-1000:]
    assert trace["velocity_m_s"].abs().max() < 1e-4
    assert np.abs(drive_force_n(trace) - trace["friction_n"]).max() < 1.0
    assert trace["load_force_n"].mean() == pytest.approx(drive.gravity_n + drive.spring_n_m * 0.12, abs=2.0)


def test_what_is_left_of_the_forces_accelerates_the_mass() -> None:
    trace = simulate(SEALS, VERTICAL, sine(6.0))
    inertia_n = VERTICAL.mass_kg * np.gradient(trace["velocity_m_s"].to_numpy(), DT)
    left_n = drive_force_n(trace) - trace["friction_n"].to_numpy()
    assert np.abs(inertia_n).max() > 20.0
    assert np.mean(np.abs(left_n - inertia_n)) < 0.02 * np.mean(np.abs(inertia_n)) + 0.1


def test_oil_that_flows_in_makes_room_or_is_compressed() -> None:
    trace = simulate(SEALS, DRIVE, sine(6.0))
    x, p1, p2 = (trace[name].to_numpy() for name in ("position_m", "pressure_1_pa", "pressure_2_pa"))
    chambers = (
        (trace["volume_1_m3"], p1, DRIVE.piston_area_m2, x),
        (trace["volume_2_m3"], p2, DRIVE.annulus_area_m2, DRIVE.stroke_m - x),
    )
    for volume, pressure, area, length in chambers:
        modulus = np.array([bulk_modulus(DRIVE, value) for value in pressure])
        share = (DRIVE.dead_volume_m3 + area * length) / modulus
        squeezed = np.concatenate([[0.0], np.cumsum(0.5 * (share[1:] + share[:-1]) * np.diff(pressure))])
        expected = area * (length - length[0]) + squeezed
        assert np.abs(squeezed).max() > 1e-7
        assert np.abs(volume.to_numpy() - expected).max() < 0.02 * np.abs(squeezed).max()


def test_half_the_step_changes_friction_by_less_than_a_hundredth() -> None:
    for drive in (DRIVE, VERTICAL._replace(supply_pa=210e5, air_share=0.003)):
        coarse, fine = (simulate(SEALS, drive, sine(8.0, 0.03, 0.8), steps)["friction_n"] for steps in (20, 40))
        assert (coarse - fine).abs().mean() < 0.01 * fine.abs().mean()


def test_sliding_friction_opposes_motion_and_dissipates() -> None:
    trace = simulate(SEALS, DRIVE, sine(12.0))
    power_w = (trace["friction_n"] * trace["velocity_m_s"]).to_numpy()
    slides = trace["velocity_m_s"].abs().to_numpy() > 0.01
    assert slides.mean() > 0.7
    assert power_w[slides].min() > 0.0
    assert np.cumsum(power_w).min() * DT > -0.5, "no more than the elements hold"


def test_the_presliding_loop_closes_and_encloses_energy() -> None:
    time_s = 1e-4 * np.arange(30_000)
    velocity = 20e-6 * 2.0 * np.pi * np.cos(2.0 * np.pi * time_s)
    force = friction_of_motion(SEALS, velocity, 50e5, 80e5, 40.0, 0.0, 1.0, 1e-4)
    second, third = force[10_000:20_000], force[20_000:]
    assert np.abs(third - second).max() < 0.02 * np.ptp(second)
    assert 1e-4 * float(third @ velocity[20_000:]) > 0.2 * np.ptp(third) * 20e-6
    assert np.ptp(third) < np.ptp(friction_of_motion(SEALS, 50.0 * velocity, 50e5, 80e5, 40.0, 0.0, 1.0, 1e-4))


def test_breakaway_grows_with_the_logarithm_of_the_dwell() -> None:
    peaks = [breakaway_n(rest_s) for rest_s in (10.0, 100.0, 1000.0)]
    first, second = np.diff(peaks)
    assert first > 5.0
    assert second == pytest.approx(first, rel=0.15)


def test_each_seal_follows_its_own_pressure() -> None:
    def mean_n(p1_bar: float, p2_bar: float) -> float:
        extend_n, retract_n, _ = strengths(SEALS, p1_bar * BAR, p2_bar * BAR, 0.0, 0.0, 1.0, 1.0)
        return 0.5 * (extend_n + retract_n)

    assert mean_n(120.0, 100.0) == pytest.approx(mean_n(80.0, 100.0)), "the piston seal sees |p1 - p2|"
    assert mean_n(100.0, 100.0) > mean_n(50.0, 50.0) + 50.0, "the rod seal sees p2"
    assert mean_n(100.0, 0.0) > mean_n(0.0, 0.0) + 100.0


def test_strength_falls_then_shear_rises_with_speed_and_both_with_cold_oil() -> None:
    def sliding_n(speed: float, oil_c: float = 40.0) -> float:
        return float(friction_of_motion(SEALS, np.full(4000, speed), 50e5, 80e5, oil_c, 0.0, 0.0, DT)[-1])

    slow, middle, fast = sliding_n(0.002), sliding_n(0.08), sliding_n(0.6)
    assert slow > 1.3 * middle
    assert fast > 1.05 * middle
    assert sliding_n(0.6, 20.0) > fast > sliding_n(0.6, 60.0)
    assert sliding_n(0.02, 20.0) < sliding_n(0.02, 60.0), "cold oil carries sooner"
    assert viscosity_ratio(100.0) == pytest.approx(6.8 / 46.0, rel=0.01)


def test_retraction_and_the_far_end_of_the_bore_take_more() -> None:
    extend_n, retract_n, _ = strengths(SEALS, 50e5, 80e5, 0.0, 0.0, 1.0, 1.0)
    assert retract_n > 1.05 * extend_n
    near, far = (strengths(SEALS, 50e5, 80e5, place, 0.0, 1.0, 1.0)[0] for place in (-1.0, 1.0))
    assert far > 1.05 * near


def test_elements_share_the_whole_strength() -> None:
    share, stiffness = element_shares(SEALS)
    assert len(share) == ELEMENTS
    assert share.sum() == pytest.approx(1.0)
    assert np.all(np.diff(stiffness) < 0.0)
    assert damping(SEALS, 50e5, 80e5, 0.0, 1.0, 1.0) > SEALS.presliding_n_s_m


def test_oil_stiffens_with_pressure_and_softens_with_air() -> None:
    moduli = [bulk_modulus(DRIVE, pressure) for pressure in (0.0, 10e5, 50e5, 200e5)]
    assert np.all(np.diff(moduli) > 0.0)
    assert bulk_modulus(DRIVE._replace(air_share=0.012), 10e5) < moduli[1]
    assert bulk_modulus(DRIVE._replace(air_share=0.0), 0.0) == pytest.approx(DRIVE.liquid_modulus_pa)


def test_an_edge_follows_the_root_of_the_drop_and_never_closes_wholly() -> None:
    (small, _), (large, slope) = edge(DRIVE, 1.0, 50e5), edge(DRIVE, 1.0, 200e5)
    assert large == pytest.approx(2.0 * small, rel=0.05)
    assert edge(DRIVE, 1.0, -200e5)[0] == -large
    assert (edge(DRIVE, 1.0, 200.01e5)[0] - large) / 1e3 == pytest.approx(slope, rel=1e-3)
    assert 0.0 < opening(DRIVE, 0.0) < 0.005 < opening(DRIVE, 0.1)


def test_a_reference_beyond_the_stroke_is_refused() -> None:
    expected = r"servo rig: after \d\.\d{3} s the position is outside 0 to 0.3 m; expected a reference that keeps clear"
    with pytest.raises(ValueError, match=expected):
        simulate(SEALS, DRIVE, 0.15 + 0.1 * DT * np.arange(3001))


def test_the_rig_takes_nothing_from_the_default_rig_and_its_friction() -> None:
    folder = Path(package.__file__).parent
    for name in ("parameters", "dynamics", "simulate", "references", "sessions"):
        source = (folder / f"{name}.py").read_text(encoding="utf-8")
        assert "import" in source
        assert "cylinder_friction.rig" not in source.partition('"""\n\nfrom')[2], name
        assert "friction_models" not in source, name
