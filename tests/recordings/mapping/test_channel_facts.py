"""What names of channels say, in English, German and the habits of loggers."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cylinder_friction.recordings.mapping.channel_facts import words_of


@pytest.mark.parametrize(
    ("name", "quantity", "side", "unit"),
    [
        ("P1 [bar]", "pressure", 1, "bar"),
        ("P2 [bar]", "pressure", 2, "bar"),
        ("p_A", "pressure", 1, ""),
        ("pB", "pressure", 2, ""),
        ("PA", "pressure", 1, ""),
        ("pb", "pressure", 2, ""),
        ("jib_pA_cyl_bar", "pressure", 1, "bar"),
        ("pS_bar", "pressure", -1, "bar"),
        ("pressure_cap (psi)", "pressure", 1, "psi"),
        ("Rod pressure", "pressure", 2, ""),
        ("PistonPressure", "pressure", 1, ""),
        ("annulus_pressure_MPa", "pressure", 2, "MPa"),
        ("Druck Kolbenseite", "pressure", 1, ""),
        ("Druck Stangenseite", "pressure", 2, ""),
        ("Kolbenstangendruck", "pressure", 2, ""),
        ("Tankdruck T", "pressure", -1, ""),
        ("Position [mm]", "length", 0, "mm"),
        ("Piston position", "length", 1, ""),
        ("x", "length", 0, ""),
        ("x_p", "length", 0, ""),
        ("jib_x_m", "length", 0, "m"),
        ("s [mm]", "length", 0, "mm"),
        ("Weg", "length", 0, ""),
        ("stroke", "length", 0, ""),
        ("t", "time", 0, ""),
        ("t_s", "time", 0, "s"),
        ("Zeit", "time", 0, ""),
        ("Timestamp", "time", 0, ""),
        ("Time [s]", "time", 0, "s"),
        ("T", "temperature", 0, ""),
        ("T_oil", "temperature", 0, ""),
        ("Temp [°C]", "temperature", 0, "°C"),
        ("F", "force", 0, ""),
        ("F_kN", "force", 0, "kN"),
        ("Kraft [kN]", "force", 0, "kN"),
        ("Load cell", "force", 0, ""),
        ("velocity", "other", 0, ""),
        ("main_u", "other", 0, ""),
        ("v [mm/s]", "other", 0, "mm/s"),
        ("p1_V", "pressure", 1, "V"),
        ("column_3", None, 0, ""),
        ("", None, 0, ""),
    ],
)
def test_names(name: str, quantity: str | None, side: int, unit: str) -> None:
    words = words_of(name)
    assert (words.quantity, words.unit) == (quantity, unit)
    if quantity == "pressure":
        assert words.side == side


@pytest.mark.parametrize("name", ["jib_xref_m", "Soll-Position", "x_set", "PosCmd", "p1 target"])
def test_set_points_are_known(name: str) -> None:
    assert words_of(name).wanted_value


@pytest.mark.parametrize(("name", "rest"), [("jib_pA_cyl_bar", ("jib",)), ("main_x_m", ("main",)), ("P1 [bar]", ())])
def test_what_is_left_names_the_cylinder(name: str, rest: tuple[str, ...]) -> None:
    assert words_of(name).rest == rest


@given(st.text(max_size=30))
def test_any_text_is_a_name(name: str) -> None:
    words_of(name)
