"""Parameter files: the Modelica record follows the grammar of a record, the MATLAB script consists of assignments."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimation.identified_model import (
    SLOW_PARAMETERS,
    IdentifiedModel,
    Zeros,
    determined,
    matlab_script,
    modelica_record,
)
from cylinder_friction.friction_models.identification.procedure import Identification
from cylinder_friction.friction_models.identification.steady_points import SteadyPoint
from cylinder_friction.friction_models.lugre import LuGre
from friction_samples import ODD

NAME = 'the "left" one \\ 63x28'
CYLINDER = Cylinder(name=NAME, bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0)
KNOWN = Zeros(0.0)
STRING = r'"(?:[^"\\\n]|\\["\\])*"'
NUMBER = r"-?\d+(?:\.\d+)?(?:e[+-]\d+)?"
COMPONENT = re.compile(rf"  parameter Real (\w+)\(unit = {STRING}\)(?: = ({NUMBER}))? {STRING};")
ASSIGNMENT = re.compile(rf"friction\.([a-z]\w*) = ({NUMBER}|NaN); % \[[^\]]+\] .+")


def identified(
    pressure_scaled: bool, factor: float = 1.05, zeros: Zeros = KNOWN, unseen: str = "", **values: float
) -> IdentifiedModel:
    """Return a model whose intervals reach a factor to either side."""
    model, parameters = LuGre(pressure_scaled), replace(ODD["lugre"], **values)
    intervals = {
        spec.name: (parameters.value(spec.name) / factor, parameters.value(spec.name) * factor)
        for spec in model.searched
    }
    points = tuple(SteadyPoint(way * 1e-3, way * 300.0, 290.0, 310.0, 50) for way in (-1.0, 1.0))
    curve = parameters.curve  # type: ignore[attr-defined]
    found = Identification(parameters, "exact", intervals, points, curve, 5.0, 300.0, (5.0,))
    known = determined(model, found, zeros, dict.fromkeys(SLOW_PARAMETERS, unseen))
    return IdentifiedModel(model.name, model.title, ("a", "b"), "", known, found)


def values_of(model: IdentifiedModel) -> dict[str, object]:
    return {each.name: each.value and pytest.approx(each.value, rel=1e-8) for each in model.parameters}


@pytest.mark.parametrize("pressure_scaled", [False, True])
def test_record_and_script_hold_every_parameter_and_comments(pressure_scaled: bool) -> None:
    model = identified(pressure_scaled)
    first, *body, last, end = modelica_record(model, CYLINDER).split("\n")
    assert re.fullmatch(rf"record {model.name} {STRING}", first)
    assert (last, end) == (f"end {model.name};", "")
    components = [COMPONENT.fullmatch(line) for line in body if not line.startswith("  // ")]
    assert None not in components
    assert {found[1]: float(found[2]) for found in components if found is not None} == values_of(model)
    assert ("pressure_slope_n_pa" in values_of(model)) == pressure_scaled
    lines = matlab_script(model, CYLINDER).splitlines()
    assigned = [ASSIGNMENT.fullmatch(line) for line in lines if not line.startswith("% ")]
    assert {found[1]: float(found[2]) for found in assigned if found is not None} == values_of(model)
    assert any("dz/dt" in line for line in lines)


def test_a_parameter_with_a_wide_interval_has_no_number_and_its_damping_neither() -> None:
    model = identified(False, factor=2.5)
    assert all(each.value is None for each in model.parameters)
    components = [COMPONENT.fullmatch(line) for line in modelica_record(model, CYLINDER).splitlines()]
    assert [found[2] for found in components if found is not None] == [None] * len(model.parameters)
    notes = {each.name: each.note for each in model.parameters}
    assert notes["coulomb_n"] == "its interval spans more than a factor of 4"
    assert notes["bristle_damping_n_s_m"] == "follows from bristle_stiffness_n_m, which is not determined"


def test_the_reason_names_what_is_missing() -> None:
    at_limits = identified(False, bristle_stiffness_n_m=9.7e7, retract_ratio=0.41, stribeck_exponent=0.54)
    notes = {each.name: each.note.removeprefix("its interval ends at a limit of ") for each in at_limits.parameters}
    assert notes["bristle_stiffness_n_m"] == "the search, 100000 to 100000000 N/m"
    assert (notes["retract_ratio"], notes["stribeck_exponent"]) == ("the search, 0.4 to 2.5", "the search, 0.5 to 3")
    notes = {each.name: each.note for each in identified(False, stribeck_velocity_m_s=0.097).parameters}
    assert "shape of a fall of friction over the speed stribeck_velocity_m_s, which is" in notes["stribeck_exponent"]
    unknown = identified(True, zeros=Zeros(math.inf, "zeros are not stated"), unseen="not seen")
    notes = {each.name: each.note for each in unknown.parameters}
    assert {notes[name] for name in ("coulomb_n", "retract_ratio", "pressure_slope_n_pa")} == {"zeros are not stated"}
    assert (notes["static_n"], notes["stribeck_exponent"], notes["viscous_n_s_m"]) == ("not seen", "not seen", "")


def test_a_value_that_is_too_wide_to_use_says_so_and_what_narrows_it() -> None:
    wide, sure = identified(False, factor=1.9), identified(False)
    (stiffness,) = (each for each in wide.parameters if each.name == "bristle_stiffness_n_m")
    assert stiffness.half_percent == pytest.approx(50.0 * (1.9 - 1.0 / 1.9))
    assert stiffness.remark.startswith("too wide to use: smoothing makes bristles seem up to twice as soft")
    assert "too wide to use: smoothing makes" in modelica_record(wide, CYLINDER)
    assert "too wide to use" in matlab_script(wide, CYLINDER)
    assert "too wide to use" not in modelica_record(sure, CYLINDER)
    assert wide.to_dict()["parameters"]["coulomb_n"]["note"].startswith("too wide to use: record more strokes")
    zeros = identified(False, factor=1.9, zeros=Zeros(100.0)).to_dict()["parameters"]["coulomb_n"]
    assert zeros["note"].startswith("too wide to use: state how exact the sensors are")
