"""C source of the LSTM: laid out so that any compiler vectorises it without leave to reorder sums.

The gates of all nodes are one row of sums, and every source (input or hidden value) adds its weights to the whole row,
eight sources in one pass, so that a sum is loaded and stored once for eight products. Weights lie in tiles of 8 sources
by 16 gates, in the order in which they are read. Neighbouring sums do not depend on each other, so they share vector
registers; each still adds bias, inputs, recurrent inputs one after the other, as ``estimators.lstm`` does, with the
same activations. Without fused multiply-add the result is the same to the last bit.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.deployment.c_export.literals import number, numbers
from cylinder_friction.realtime.activation import TANH_DENOMINATOR, TANH_LIMIT, TANH_NUMERATOR
from cylinder_friction.realtime.lstm import TINY

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cylinder_friction.realtime.lstm import LstmWeights

AT_ONCE = 8
"""Sources added in one pass."""
ACROSS = 16
"""Gates in a tile: what every vector unit's width divides."""
ACTIVATION_OPERATIONS = 14
"""Of one sigmoid or hyperbolic tangent, the division counted as one."""


def network_operations(weights: LstmWeights, head: bool) -> int:
    """Return multiply-adds of one step, and the operations of the activations."""
    sums = sum(layer_weights(weights, layer).size for layer in range(weights.layers))
    activations = weights.layers * weights.nodes * (5 * ACTIVATION_OPERATIONS + 3)
    return sums + activations + (weights.nodes if head else 0)


def layer_weights(weights: LstmWeights, layer: int) -> NDArray[np.float32]:
    """Return one layer's weights in the order in which C reads them: bias, tiles, rows too few for a tile."""
    inputs = weights.inputs if layer == 0 else weights.nodes
    rows = np.concatenate([weights.bias[layer][None], weights.input[layer][:inputs], weights.recurrent[layer]])
    rows = np.pad(rows, ((0, 0), (0, -rows.shape[1] % ACROSS)))
    tiled = len(rows) - 1 - (len(rows) - 1) % AT_ONCE
    tiles = rows[1 : 1 + tiled].reshape(-1, AT_ONCE, rows.shape[1] // ACROSS, ACROSS).transpose(0, 2, 1, 3)
    return np.concatenate([rows[0], tiles.ravel(), rows[1 + tiled :].ravel()])


def network_source(weights: LstmWeights, head: bool) -> str:
    """Return the weights, ``run_network`` and, where asked for, ``run_head``; all in single precision, as trained."""
    tables, calls = [], []
    for index in range(weights.layers):
        values = layer_weights(weights, index)
        inputs = weights.inputs if index == 0 else weights.nodes
        source = "features" if index == 0 else f"state->hidden[{index - 1}]"
        tables.append(
            f"static const float LAYER_{index}[{values.size}] ALIGNED = {{\n{numbers(values, 'float')}\n}};\n"
        )
        calls.append(f"    run_layer(LAYER_{index}, {inputs}, {source}, state->hidden[{index}], state->cell[{index}]);")
    return "\n".join(
        [
            f"""\
/* Network: LSTM layers of NODES nodes; the gates i, o, f, c of all nodes are one row. */
#define LAYERS {weights.layers}
#define NODES {weights.nodes}
#define ROW {-(-4 * weights.nodes // ACROSS) * ACROSS}
#define ACROSS {ACROSS}
#define AT_ONCE {AT_ONCE}
#define WIDEST {max(weights.inputs, weights.nodes)}
""",
            *tables,
            _ACTIVATIONS.format(
                limit=number(float(TANH_LIMIT), "float"),
                numerator=_polynomial(TANH_NUMERATOR),
                denominator=_polynomial(TANH_DENOMINATOR),
                tiny=number(float(TINY), "float"),
            ),
            _LAYER,
            *([_head_source(weights)] if head else []),
            "static void run_network(@name@_state *state, const float features[FEATURES])\n{\n"
            + "\n".join(calls)
            + "\n}\n",
        ]
    )


def _polynomial(coefficients: tuple[np.float32, ...]) -> str:
    """Return Horner's scheme in ``square``, lowest coefficient first in the argument."""
    *lower, text = [number(float(value), "float") for value in coefficients]
    for value in reversed(lower):
        text = f"({text}) * square + {value}" if "*" in text else f"{text} * square + {value}"
    return text


def _head_source(weights: LstmWeights) -> str:
    return f"""\
static const float HEAD[NODES] = {{
{numbers(weights.head, "float")}
}};

static float run_head(const float hidden[NODES])
{{
    float total = {number(weights.head_bias, "float")};
    int node;
    for (node = 0; node < NODES; ++node) {{
        total += hidden[node] * HEAD[node];
    }}
    return total;
}}
"""


_ACTIVATIONS = """\
/* x P(x^2) / Q(x^2), which is tanh but for 4.2e-7 of it; beyond {limit} it no longer changes. */
static float hyperbolic_tangent(float x)
{{
    const float y = x < -{limit} ? -{limit} : x > {limit} ? {limit} : x;
    const float square = y * y;
    const float p = {numerator};
    const float q = {denominator};
    return y * p / q;
}}

static float sigmoid(float x)
{{
    return 0.5f * hyperbolic_tangent(0.5f * x) + 0.5f;
}}

/* Values that decay towards zero would become denormal, and slow on many processors. */
static float flushed(float x)
{{
    return x > -{tiny} && x < {tiny} ? 0.0f : x;
}}
"""

_LAYER = f"""\
/* Adds each source times its weights to the gates, tile by tile. */
static void add_products(float *restrict gates, const float *restrict weights, const float *restrict sources, int count)
{{
    int from, gate;
    for (; count >= AT_ONCE; count -= AT_ONCE, sources += AT_ONCE) {{
        for (from = 0; from < ROW; from += ACROSS, weights += AT_ONCE * ACROSS) {{
            for (gate = 0; gate < ACROSS; ++gate) {{
                float total = gates[from + gate];
{chr(10).join(f"                total += weights[{n} * ACROSS + gate] * sources[{n}];" for n in range(AT_ONCE))}
                gates[from + gate] = total;
            }}
        }}
    }}
    for (; count > 0; --count, ++sources, weights += ROW) {{
        for (gate = 0; gate < ROW; ++gate) {{
            gates[gate] += weights[gate] * sources[0];
        }}
    }}
}}

static void run_layer(const float *weights, int inputs, const float *input, float hidden[NODES], float cell[NODES])
{{
    float gates[ROW] ALIGNED;
    float sources[WIDEST + NODES];
    int gate, node;
    memcpy(gates, weights, sizeof gates);
    memcpy(sources, input, (size_t)inputs * sizeof *input);
    memcpy(sources + inputs, hidden, NODES * sizeof *hidden);
    add_products(gates, weights + ROW, sources, inputs + NODES);
    for (gate = 0; gate < 3 * NODES; ++gate) {{
        gates[gate] = sigmoid(gates[gate]);
    }}
    for (gate = 3 * NODES; gate < 4 * NODES; ++gate) {{
        gates[gate] = hyperbolic_tangent(gates[gate]);
    }}
    for (node = 0; node < NODES; ++node) {{
        cell[node] = flushed(gates[2 * NODES + node] * cell[node] + gates[node] * gates[3 * NODES + node]);
        hidden[node] = flushed(gates[NODES + node] * hyperbolic_tangent(cell[node]));
    }}
}}
"""
