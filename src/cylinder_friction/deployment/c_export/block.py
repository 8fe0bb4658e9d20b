"""What makes one kind of estimator in C: its share of the state, its functions, its cost."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from cylinder_friction.deployment.c_export.filters import LIMIT_OPERATIONS, feature_source
from cylinder_friction.deployment.c_export.forest import flatten, forest_source
from cylinder_friction.deployment.c_export.literals import number
from cylinder_friction.deployment.c_export.network import network_operations, network_source

if TYPE_CHECKING:
    from cylinder_friction.deployment.c_export.filters import FilterBank
    from cylinder_friction.deployment.c_export.literals import Type
    from cylinder_friction.realtime.model import StepModel

Role = Literal["real", "float", "uint32_t", "int32_t"]


@dataclass(frozen=True)
class StateField:
    """One array of the state: element type, name, shape (empty for a single value) and what it is."""

    role: Role
    name: str
    shape: tuple[int, ...]
    comment: str

    @property
    def count(self) -> int:
        return int(np.prod(self.shape, dtype=np.int64))

    @property
    def declarator(self) -> str:
        return self.name + "".join(f"[{extent}]" for extent in self.shape)


@dataclass(frozen=True)
class EstimateBlock:
    """The part of a step between the filters and the bounds.

    Attributes:
        fields: Its state, all zero after a reset.
        begin: Statements for the first sound sample, with ``state`` and ``filtered`` in scope.
        code: Functions, the last of them ``estimate(state, filtered)``, friction [N].
        operations: Of one step.
    """

    fields: tuple[StateField, ...]
    begin: str
    code: str
    operations: int


def learned_block(model: StepModel, bank: FilterBank, real: Type) -> EstimateBlock:
    """Return the block of a model made of base force, network and forest, whichever of them it has."""
    parts, fields = [], []
    operations = 4
    if model.network is not None or model.forest is not None:
        parts.append(f"#define FEATURES {len(bank.feature)}\n\n{feature_source(model, bank, real)}")
        operations += 2 * len(bank.feature) + LIMIT_OPERATIONS * int(np.count_nonzero(model.feature_limits > 0.0))
    if model.network is not None:
        shape = (model.network.layers, model.network.nodes)
        fields = [
            StateField("float", "hidden", shape, "output of each layer's nodes"),
            StateField("float", "cell", shape, "memory of each layer's nodes"),
        ]
        parts.append(network_source(model.network, _needs_head(model)))
        operations += network_operations(model.network, _needs_head(model))
    if model.forest is not None:
        flat = flatten(model.forest)
        parts.append(forest_source(flat, model.forest.inputs))
        operations += flat.operations()
    parts.append(_estimate_source(model, bank, real))
    return EstimateBlock(tuple(fields), "", "\n".join(parts), operations)


def _estimate_source(model: StepModel, bank: FilterBank, real: Type) -> str:
    mean, scale = number(model.target_mean_n, real), number(model.target_scale_n, real)
    declared, lines = [], []
    if model.network is not None or model.forest is not None:
        declared.append("float features[FEATURES];")
        lines.append("make_features(filtered, features);")
    if model.network is not None:
        lines.append("run_network(state, features);")
        if _needs_head(model):
            declared.append("float head;")
            lines.append("head = run_head(state->hidden[LAYERS - 1]);")
        if model.head_counts:
            lines.append(f"friction += {scale} * (real)head;")
    if model.forest is not None:
        declared += ["float inputs[FOREST_INPUTS];", "int index;", "float *next = inputs;"]
        lines += _forest_inputs(model)
        lines.append(f"friction += {scale} * run_forest(inputs);")
    unused = ["(void)state;"] if model.network is None else []
    base = number(0.0, real) if bank.base is None else f"filtered[{bank.base}]"
    body = "\n".join(f"    {line}" for line in [*declared, f"real friction = {base} + {mean};", *unused, *lines])
    return f"""\
static real estimate(@name@_state *state, const real filtered[ROWS])
{{
{body}
    return friction;
}}
"""


def _needs_head(model: StepModel) -> bool:
    return model.head_counts or model.forest_sees == "hidden_head_features"


def _forest_inputs(model: StepModel) -> list[str]:
    """Return the statements that copy what the forest sees, in the order of ``forest_sees``."""
    sources = {
        "nothing": [],
        "hidden": [("NODES", "state->hidden[LAYERS - 1]")],
        "hidden_head_features": [("NODES", "state->hidden[LAYERS - 1]"), ("1", "&head"), ("FEATURES", "features")],
        "features": [("FEATURES", "features")],
    }[model.forest_sees]
    lines = []
    for count, array in sources:
        if count == "1":
            lines.append(f"*next++ = {array.removeprefix('&')};")
        else:
            lines += [f"for (index = 0; index < {count}; ++index) {{", f"    *next++ = {array}[index];", "}"]
    return lines
