"""What names of channels say, in English, German and the habits of loggers."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cylinder_friction.recordings.mapping.channel_facts import words_of


@pytest.mark.parametrize(
    ("name", "quantity", "side", "unit"),
    [
        ("P1 [bar]", "pressure", 1, "bar"),
        ("p_A", "pressure", 1, ""),
        ("pB", "pressure", 2, ""),
        ("jib_pA_cyl_bar", "pressure", 1, "bar"),
        ("pS_bar", "pressure", -1, "bar"),
        ("pressure_cap (psi)", "pressure", 1, "psi"),
        ("PistonPressure", "pressure", 1, ""),
        ("annulus_pressure_MPa", "pressure", 2, "MPa"),
        ("Druck Kolbenseite", "pressure", 1, ""),
        ("Kolbenstangendruck", "pressure", 2, ""),
        ("Tankdruck T", "pressure", -1, ""),
        ("Piston position", "length", 1, ""),
        ("x", "length", 0, ""),
        ("x_p", "length", 0, ""),
        ("s [mm]", "length", 0, "mm"),
        ("Weg", "length", 0, ""),
        ("t", "time", 0, ""),
        ("Zeit", "time", 0, ""),
        ("T", "temperature", 0, ""),
        ("Temp [°C]", "temperature", 0, "°C"),
        ("F", "force", 0, ""),
        ("Kraft [kN]", "force", 0, "kN"),
        ("Load cell", "force", 0, ""),
        ("main_u", "other", 0, ""),
        ("v [mm/s]", "other", 0, "mm/s"),
        ("p1_V", "pressure", 1, "V"),
        ("", None, 0, ""),
    ],
)
def test_names(name: str, quantity: str | None, side: int, unit: str) -> None:
    words = words_of(name)
    assert (words.quantity, words.unit) == (quantity, unit)
    if quantity == "pressure":
        assert words.side == side


def test_set_points_are_known_and_what_is_left_names_the_cylinder() -> None:
    assert all(words_of(name).wanted_value for name in ("jib_xref_m", "Soll-Position", "x_set", "PosCmd", "p1 target"))
    assert [words_of(name).rest for name in ("jib_pA_cyl_bar", "main_x_m", "P1 [bar]")] == [("jib",), ("main",), ()]


@given(st.text(max_size=30))
def test_any_text_is_a_name(name: str) -> None:
    words_of(name)
