"""What labels, estimates or scores knows nothing of the rig: it imports nothing of it and repeats no value by name."""

import ast
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

import yaml

import cylinder_friction
from cylinder_friction.friction_models.catalogue import MODELS
from cylinder_friction.rig.parameters import FrictionParameters, HydraulicParameters, SensorParameters

SOURCE = Path(cylinder_friction.__file__).parent
MODULES = sorted(path for path in SOURCE.rglob("*.py") if SOURCE / "rig" not in path.parents)
VALUES = {
    each.name: each.default
    for kind in (FrictionParameters, HydraulicParameters, SensorParameters)
    for each in fields(kind)
    if isinstance(each.default, float)
}
CLOSE = 0.2
SIMULATES = ("commands/init.py", "params/checking.py", "stages/record.py")
WRITES_RECORDINGS = [SOURCE / each for each in SIMULATES]
"""A new project's example log, the campaign and the check of its settings."""


def repeats(name: str, value: object) -> bool:
    known = VALUES.get(name.lower())
    return isinstance(value, float) and known is not None and abs(value - known) <= CLOSE * abs(known)


def named_numbers(tree: ast.AST) -> Iterator[tuple[str, object]]:
    """Yield the constants, fields and arguments that have a literal for value or default."""
    for node in ast.walk(tree):
        pairs: list[tuple[str, ast.expr | None]] = []
        if isinstance(node, ast.Assign):
            pairs = [(target.id, node.value) for target in node.targets if isinstance(target, ast.Name)]
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            pairs = [(node.target.id, node.value)]
        elif isinstance(node, ast.arguments):
            positional = [*node.posonlyargs, *node.args]
            with_default = positional[len(positional) - len(node.defaults) :]
            pairs = [(each.arg, value) for each, value in zip(with_default, node.defaults, strict=True)]
            pairs += [(each.arg, value) for each, value in zip(node.kwonlyargs, node.kw_defaults, strict=True)]
        yield from ((name, value.value) for name, value in pairs if isinstance(value, ast.Constant))


def leaves(content: object, name: str = "") -> Iterator[tuple[str, object]]:
    if isinstance(content, dict):
        for key, value in content.items():
            yield from leaves(value, key)
    else:
        yield name, content


def test_no_module_imports_the_rig_or_repeats_a_value_of_it() -> None:
    imports, repeated = [], []
    for path in MODULES:
        tree = ast.parse(path.read_text(encoding="utf-8"))
        modules = [node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
        if any(name.startswith("cylinder_friction.rig") for name in modules):
            imports.append(path)
        repeated += [(path, name) for name, value in named_numbers(tree) if repeats(name, value)]
    assert sorted(imports) == sorted(WRITES_RECORDINGS)
    assert repeated == []


def test_no_parameter_of_a_later_stage_repeats_a_value_of_the_rig() -> None:
    params = yaml.safe_load((SOURCE.parents[1] / "params.yaml").read_text(encoding="utf-8"))
    later = {stage: section for stage, section in params.items() if stage not in ("cylinder", "record")}
    assert not [name for name, value in leaves(later) if repeats(name, value)]


def test_no_search_starts_at_a_value_of_the_rig_or_is_centred_on_one() -> None:
    specs = {spec.name: spec for model in MODELS.values() for spec in model.specs}
    assert not [name for name, spec in specs.items() if repeats(name, spec.first)]
    centres = {name: (spec.lower * spec.upper) ** 0.5 for name, spec in specs.items() if spec.logarithmic}
    assert not [name for name, centre in centres.items() if repeats(name, centre)]


def test_a_value_of_the_rig_would_be_noticed() -> None:
    tree = ast.parse("STRIBECK_VELOCITY_M_S = 8e-3\ndef f(*, film_build_s=0.05, static_ratio=3.0): ...")
    assert [name for name, value in named_numbers(tree) if repeats(name, value)] == [
        "STRIBECK_VELOCITY_M_S",
        "film_build_s",
    ]
