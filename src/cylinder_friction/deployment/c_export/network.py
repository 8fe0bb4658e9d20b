"""The LSTM of the C: laid out so that any compiler vectorises it without permission to reorder sums.

The gates of all nodes are one row of sums, and every source (input or hidden value) adds its weights to the whole row,
eight sources in one pass, so that a sum is loaded and stored once for eight products. Weights lie in tiles of 8 sources
by 16 gates, in the order in which they are read. Neighbouring sums do not depend on each other, so they share vector
registers; each still adds bias, inputs, recurrent inputs one after the other, as ``realtime.lstm`` does, with the
same activations. Without fused multiply-add the result is the same to the last bit.
"""

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.realtime.lstm import TANH_DENOMINATOR, TANH_LIMIT, TANH_NUMERATOR, TINY, LstmWeights

AT_ONCE = 8  # Sources added in one pass
ACROSS = 16  # Gates in a tile: what every vector unit's width divides
ACTIVATION_OPERATIONS = 14  # Of one sigmoid or hyperbolic tangent, the division counted as one


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


def network_values(weights: LstmWeights, head: bool) -> dict[str, object]:
    """Return the values of the network's template; ``head`` adds the linear head."""
    layers = [
        {
            "weights": layer_weights(weights, layer),
            "inputs": weights.inputs if layer == 0 else weights.nodes,
            "row": -(-4 * weights.nodes // ACROSS) * ACROSS,
        }
        for layer in range(weights.layers)
    ]
    tanh = {"limit": TANH_LIMIT, "numerator": TANH_NUMERATOR, "denominator": TANH_DENOMINATOR}
    return {"layers": layers, "head": head, "across": ACROSS, "at_once": AT_ONCE, "tanh": tanh, "tiny": TINY}
