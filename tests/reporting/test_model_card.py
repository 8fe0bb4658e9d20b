"""What a user of a registered model reads about it."""

from __future__ import annotations

from dataclasses import asdict, fields

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.realtime.model import Bounds, Guard
from cylinder_friction.reporting.model_card import model_card

CYLINDER = Cylinder(name="A", bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0)
BOUNDS = Bounds((-9.0,) * 4, (9.0,) * 4, 1e-4, 1e-3, 20, 0.9, "friction")
DESCRIPTION = {
    "input": ["pressure_1_pa", "position_m", "load_force_n"],
    "sample_time_s": 0.005,
    "lag_s": 0.0,
    "multiply_adds_a_step": 1234,
    "bounds": asdict(BOUNDS),
    # as JSON sorts it, which is not the order of the inputs
    "training_range": {"load_force_n": [-10.0, 10.0], "position_m": [0.0, 0.25], "pressure_1_pa": [1e5, 6e6]},
}
NUMBERS = {
    "truth_percent": 1.395,
    "truth_percent_low": 0.98,
    "truth_percent_high": 1.81,
    "truth_mae_n": 5.05,
    "label_percent": 1.1,
}
HELD = [
    {"reference": "truth", "by": "condition", "group": "1", "held_percent": 96.75},
    {"reference": "truth", "by": "condition", "group": "all", "held_percent": 94.63},
    {"reference": "label", "by": "condition", "group": "1", "held_percent": 98.6},
]


def card(conditions: dict[str, dict[str, float]], held: list[dict[str, object]]) -> list[str]:
    recordings = {"train": 40, "validation": 8}
    chosen = {"layers": 1, "nodes": 24}
    return model_card("hybrid", CYLINDER, DESCRIPTION, chosen, recordings, conditions, held).splitlines()


def test_it_states_training_errors_bounds_and_range() -> None:
    lines = card({"1": NUMBERS}, HELD)
    assert lines[0].endswith("[N] from `pressure_1_pa`, `position_m`, `load_force_n`.")
    assert "- Trained on: 40 recordings; 8 of other sessions decided when training stopped" in lines
    assert "- Hyperparameters: layers 1, nodes 24" in lines
    assert "**Mean absolute errors on held-out recordings, against true friction**" in lines
    assert "| 1 | 1.40 | 0.98 to 1.81 | 5.0 | 96.8 |" in lines
    assert f"Bounds: {BOUNDS.in_words()}. They hold true friction in 94.6 % of all rows." in lines
    assert "| pressure 1 [bar] | -1.95 | 62.95 | 1 to 60 |" in lines
    assert "| position [mm] | -12.5 | 262.5 | 0 to 250 |" in lines
    assert "| load force [N] | -11 | 11 | -10 to 10 |" in lines


def test_what_is_not_known_is_left_empty() -> None:
    lines = card({"1": {"label_percent": 2.0}}, [])
    assert "**Mean absolute errors on held-out recordings, against the label, which it was trained on**" in lines
    assert "| 1 | 2.00 |  |  |  |" in lines
    assert f"Bounds: {BOUNDS.in_words()}." in lines


def test_the_valid_range_is_that_of_the_guard() -> None:
    limits = {"trained_lower": (0.5e5, -0.01, -11.0), "trained_upper": (7e6, 0.2, 11.0)}
    guard = Guard(**{each.name: limits.get(each.name, ()) for each in fields(Guard)})
    described = {**DESCRIPTION, "guard": {**vars(guard)}}
    text = model_card("hybrid", CYLINDER, described, {}, {"train": 1}, {"1": NUMBERS}, HELD)
    assert "| pressure 1 [bar] | 0.5 | 70 | 1 to 60 |" in text
    assert "| position [mm] | -10 | 200 | 0 to 250 |" in text
