"""Identified parameters as text that simulators read: a Modelica record and a MATLAB script."""

from collections.abc import Sequence

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimation.identified_model import IdentifiedModel, IdentifiedParameter

MATLAB_VARIABLE = "friction"
"""The structure that the script defines; a variable of the script's own name would hide the script."""
SIGNS = (
    "F [N] opposes positive velocity v [m/s] when positive; extension is positive.",
    "p [Pa] is the sum of both gauge pressures, at least 0.",
)


def modelica_record(model: IdentifiedModel, cylinder: Cylinder, confidence: float) -> str:
    """Return a record of the model's name; a parameter without a number has no default, so that its user must set one.

    Args:
        model: With parameters.
        cylinder: Whose.
        confidence: Of the intervals.
    """
    lines = [f'record {model.name} "{_modelica_text(_origin(model, cylinder))}"']
    lines += [f"  // {line}" for line in _comments(model)]
    for each in model.parameters:
        unit = each.unit.replace(" ", ".")
        value = "" if each.value is None else f" = {each.value:.9g}"
        words = _modelica_text(_words(each, confidence))
        lines.append(f'  parameter Real {each.name}(unit = "{unit}"){value} "{words}";')
    return "\n".join([*lines, f"end {model.name};", ""])


def matlab_script(model: IdentifiedModel, cylinder: Cylinder, confidence: float) -> str:
    """Return a script that defines a structure; what has no number is NaN. Arguments as for ``modelica_record``."""
    lines = [f"% {line}" for line in (_origin(model, cylinder), *_comments(model))]
    for each in model.parameters:
        value = "NaN" if each.value is None else f"{each.value:.9g}"
        lines.append(f"{MATLAB_VARIABLE}.{each.name} = {value}; % [{each.unit}] {_words(each, confidence)}")
    return "\n".join([*lines, ""])


def _origin(model: IdentifiedModel, cylinder: Cylinder) -> str:
    assert model.found is not None
    count = len(model.recordings)
    return (
        f"{model.title}: friction of {cylinder.name}, identified from {count} recording{'s' if count > 1 else ''}; "
        f"mean error {model.found.error_percent:.1f} % of mean friction"
    )


def _comments(model: IdentifiedModel) -> Sequence[str]:
    return *model.equation, *(SIGNS if model.pressure_scaled else SIGNS[:1])


def _words(each: IdentifiedParameter, confidence: float) -> str:
    words = f"{each.symbol}, {each.meaning}; "
    if each.value is None:
        return f"{words}not determined: {each.note}"
    if each.interval is None:
        return words + each.note
    return f"{words}{100.0 * confidence:g} % interval {each.interval[0]:.4g} to {each.interval[1]:.4g}"


def _modelica_text(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"')
