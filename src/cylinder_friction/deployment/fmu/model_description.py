"""modelDescription.xml of FMI 2.0 and 3.0, and the build description of FMI 3.0."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.metadata import version
from typing import TYPE_CHECKING, Literal
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from cylinder_friction.deployment.fmu.units import UNITS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from cylinder_friction.deployment.fmu.variables import FmuVariable

FmiVersion = Literal[2, 3]
FMI3_TYPES = {"real": "Float64", "integer": "Int32", "boolean": "Boolean"}


@dataclass(frozen=True)
class FmuFacts:
    """What is written of one model.

    Attributes:
        name: Model identifier: a C identifier, and the binary's name.
        token: Fingerprint that ties description and binary together.
        description: One sentence on the model.
        sample_time_s: The only step size [s].
        variables: In the order of their value references.
        source_files: To be compiled, relative to ``sources/``.
    """

    name: str
    token: str
    description: str
    sample_time_s: float
    variables: Sequence[FmuVariable]
    source_files: Sequence[str]


def model_description(facts: FmuFacts, fmi: FmiVersion) -> bytes:
    """Return modelDescription.xml; the same facts give the same bytes."""
    return _xml(_description_2(facts) if fmi == 2 else _description_3(facts))


def build_description(facts: FmuFacts) -> bytes:
    """Return sources/buildDescription.xml of FMI 3.0."""
    root = Element("fmiBuildDescription", fmiVersion="3.0")
    build = SubElement(root, "BuildConfiguration", modelIdentifier=facts.name)
    files = SubElement(build, "SourceFileSet", language="C99")
    for name in facts.source_files:
        SubElement(files, "SourceFile", name=name)
    SubElement(
        build, "Library", name="m", external="true", description="C's mathematics, where it is a library of its own"
    )
    return _xml(root)


def _description_2(facts: FmuFacts) -> Element:
    root = _root(facts, "2.0", "guid")
    interface = _co_simulation(root, facts, "canGetAndSetFMUstate", "canSerializeFMUstate")
    interface.set("canNotUseMemoryManagementFunctions", "true")
    files = SubElement(interface, "SourceFiles")
    for name in facts.source_files:
        SubElement(files, "File", name=name)
    _common(root, facts)
    variables = SubElement(root, "ModelVariables")
    for reference, variable in enumerate(facts.variables):
        scalar = SubElement(variables, "ScalarVariable", _attributes(variable, reference))
        SubElement(scalar, variable.kind.capitalize(), _typed_attributes(variable))
    structure = SubElement(root, "ModelStructure")
    for part, references in (("Outputs", _outputs(facts)), ("InitialUnknowns", _initial_unknowns(facts))):
        unknowns = SubElement(structure, part)
        for reference in references:  # an index counts variables from 1
            SubElement(unknowns, "Unknown", index=str(reference + 1), dependencies="")
    return root


def _description_3(facts: FmuFacts) -> Element:
    root = _root(facts, "3.0", "instantiationToken")
    interface = _co_simulation(root, facts, "canGetAndSetFMUState", "canSerializeFMUState")
    interface.set("fixedInternalStepSize", repr(facts.sample_time_s))
    _common(root, facts)
    variables = SubElement(root, "ModelVariables")
    for reference, variable in enumerate(facts.variables):
        attributes = _attributes(variable, reference) | _typed_attributes(variable)
        SubElement(variables, FMI3_TYPES[variable.kind], attributes)
    structure = SubElement(root, "ModelStructure")
    for part, references in (("Output", _outputs(facts)), ("InitialUnknown", _initial_unknowns(facts))):
        for reference in references:
            SubElement(structure, part, valueReference=str(reference), dependencies="")
    return root


def _root(facts: FmuFacts, fmi_version: str, token_attribute: str) -> Element:
    return Element(
        "fmiModelDescription",
        {
            "fmiVersion": fmi_version,
            "modelName": facts.name,
            token_attribute: facts.token,
            "description": facts.description,
            "generationTool": f"cylinder-friction {version('cylinder-friction')}",
            "variableNamingConvention": "structured",
        },
    )


def _co_simulation(root: Element, facts: FmuFacts, *state_attributes: str) -> Element:
    return SubElement(
        root,
        "CoSimulation",
        {
            "modelIdentifier": facts.name,
            "canHandleVariableCommunicationStepSize": "false",
            "canBeInstantiatedOnlyOncePerProcess": "false",
            **dict.fromkeys(state_attributes, "true"),
        },
    )


def _common(root: Element, facts: FmuFacts) -> None:
    """Units, log categories and default experiment are written alike in both versions."""
    units = SubElement(root, "UnitDefinitions")
    for name, unit in UNITS.items():
        element = SubElement(units, "Unit", name=name)
        SubElement(element, "BaseUnit", {base: str(exponent) for base, exponent in unit.exponents.items()})
        if unit.shown_as is not None:
            SubElement(element, "DisplayUnit", name=unit.shown_as[0], factor=repr(unit.shown_as[1]))
    categories = SubElement(root, "LogCategories")
    SubElement(categories, "Category", name="logStatusError", description="Why a call was refused")
    SubElement(root, "DefaultExperiment", startTime="0.0", stepSize=repr(facts.sample_time_s))


def _attributes(variable: FmuVariable, reference: int) -> dict[str, str]:
    """Attributes of any variable; inputs and time may not state how they begin."""
    attributes = {
        "name": variable.name,
        "valueReference": str(reference),
        "description": variable.description,
        "causality": variable.causality,
        "variability": variable.variability,
    }
    if variable.calculated:
        attributes["initial"] = "calculated"
    elif variable.causality == "parameter":
        attributes["initial"] = "exact"
    return attributes


def _typed_attributes(variable: FmuVariable) -> dict[str, str]:
    attributes = {
        "unit": variable.unit,
        "displayUnit": variable.display_unit,
        "min": None if variable.minimum is None else str(variable.minimum),
        "start": None if variable.start is None else repr(variable.start),
    }
    return {name: value for name, value in attributes.items() if value is not None}


def _outputs(facts: FmuFacts) -> list[int]:
    """No output depends on an input of the same communication point: a step lies between them."""
    return [reference for reference, variable in enumerate(facts.variables) if variable.causality == "output"]


def _initial_unknowns(facts: FmuFacts) -> list[int]:
    return [reference for reference, variable in enumerate(facts.variables) if variable.calculated]


def _xml(root: Element) -> bytes:
    indent(root)
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(root, encoding="unicode").encode() + b"\n"
