"""The temporal convolutional network as an estimator, and its step at run time: one ring buffer a convolution.

Block (Bai, Kolter and Koltun 2018, figure 1): two causal convolutions, dilation 1, 2, 4, ... from block to block, each
with weight normalisation (worked into the weights once trained), ReLU and spatial dropout; the block's input is added
and goes through ReLU once more. The first block's input goes through a 1×1 convolution, for it has another width.
What lies before the first sample is zero in every layer.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numba
import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from cylinder_friction.estimators.onnx_files import IR_VERSION, OPSET
from cylinder_friction.realtime.lstm import ZERO, add_product, head_of
from friction_benchmark.models.sequence_estimator import SequenceEstimator, plain

if TYPE_CHECKING:
    import torch
    from numpy.typing import NDArray

    Single = NDArray[np.float32]


@dataclass(frozen=True)
class TcnArchitecture:
    """Residual blocks, channels of each, steps that a kernel spans, dropout rate, highest learning rate."""

    levels: int
    channels: int
    kernel: int
    dropout: float
    learning_rate: float

    def __post_init__(self) -> None:
        if min(self.levels, self.channels) < 1 or self.kernel < 2 or not 0.0 <= self.dropout < 1.0:
            raise ValueError(f"expected levels, channels >= 1, kernel >= 2 and dropout in [0, 1), but got {self}")

    def receptive_field(self) -> int:
        """Return how many steps, the present one included, an output can depend on."""
        return 1 + 2 * (self.kernel - 1) * (2**self.levels - 1)


@dataclass(frozen=True)
class TcnWeights:
    """Weights of the convolutions, two a block, and of the linear head on the last block.

    Attributes:
        kernels: One a convolution, shape ``(kernel, inputs, channels)``, the present step's tap first.
        biases: Shape ``(convolutions, channels)``.
        shortcut: The first block's 1×1 convolution, shape ``(inputs, channels)``.
        shortcut_bias: Shape ``(channels,)``.
        head: Shape ``(channels,)``.
        head_bias: Added to the head's output.
    """

    kernels: tuple[Single, ...]
    biases: Single
    shortcut: Single
    shortcut_bias: Single
    head: Single
    head_bias: float


@dataclass
class TcnState:
    """What each convolution saw, shape ``(convolutions, rows, widest)``, as rings; and the row to write next."""

    rings: Single
    place: int = 0


class Tcn:
    """Runs ``TcnWeights`` over features."""

    def __init__(self, weights: TcnWeights) -> None:
        self.weights = weights
        first = weights.kernels[0]
        widest = max(first.shape[1], first.shape[2])
        pads = [((0, 0), (0, widest - kernel.shape[1]), (0, 0)) for kernel in weights.kernels]
        self._kernels = np.stack([np.pad(kernel, pad) for kernel, pad in zip(weights.kernels, pads, strict=True)])
        self._rows = 1 + (first.shape[0] - 1) * 2 ** (len(weights.kernels) // 2 - 1)

    def new_state(self) -> TcnState:
        convolutions, _, widest, _ = self._kernels.shape
        return TcnState(np.zeros((convolutions, self._rows, widest), dtype=np.float32))

    def advance(self, state: TcnState, features: Single) -> Single:
        """Return the head's output, shape ``(n,)``."""
        w = self.weights
        output: Single = _run(
            self._kernels,
            w.biases,
            w.shortcut,
            w.shortcut_bias,
            w.head,
            w.head_bias,
            features,
            state.rings,
            state.place,
        )
        state.place = (state.place + len(features)) % self._rows
        return output

    def multiply_adds(self) -> int:
        w = self.weights
        return sum(kernel.size for kernel in w.kernels) + w.shortcut.size + len(w.head)


@numba.njit(cache=True)
def _run(
    kernels: Single,
    biases: Single,
    shortcut: Single,
    shortcut_bias: Single,
    head: Single,
    head_bias: float,
    features: Single,
    rings: Single,
    place: int,
) -> Single:
    channels, inputs = shortcut_bias.shape[0], shortcut.shape[0]
    output = np.empty(features.shape[0], dtype=np.float32)
    residual = np.empty(channels, dtype=np.float32)
    inner = np.empty(channels, dtype=np.float32)
    for row in range(features.shape[0]):
        residual[:] = shortcut_bias
        add_product(residual, shortcut, features[row], inputs)
        for convolution in range(rings.shape[0]):
            if convolution == 0:
                rings[0, place, :inputs] = features[row]
            elif convolution % 2 == 0:
                rings[convolution, place, :channels] = residual
            else:
                rings[convolution, place, :channels] = inner
            count = inputs if convolution == 0 else channels
            _convolve(
                kernels[convolution], biases[convolution], rings[convolution], place, convolution // 2, count, inner
            )
            if convolution % 2 == 1:
                for channel in range(channels):
                    residual[channel] = max(residual[channel] + inner[channel], ZERO)
        output[row] = head_of(residual, head, head_bias)
        place = (place + 1) % rings.shape[1]
    return output


@numba.njit(cache=True)
def _convolve(kernel: Single, bias: Single, ring: Single, place: int, level: int, count: int, result: Single) -> None:
    """Write ReLU of the dilated convolution's output at ``place`` into ``result``."""
    result[:] = bias
    for tap in range(kernel.shape[0]):
        seen = (place - tap * (1 << level)) % ring.shape[0]
        add_product(result, kernel[tap], ring[seen], count)
    for channel in range(result.shape[0]):
        result[channel] = max(result[channel], ZERO)


def tcn_weights_of(network: Any) -> TcnWeights:
    """Return a network's weights as plain arrays, the newest sample's tap first, weight normalisation worked in."""
    convolutions = [module.convolution for module in network.convolutions]
    kernels = [np.ascontiguousarray(plain(each.weight)[:, :, ::-1].transpose(2, 1, 0)) for each in convolutions]
    return TcnWeights(
        tuple(kernels),
        np.stack([plain(each.bias) for each in convolutions]),
        np.ascontiguousarray(plain(network.shortcut.weight).T),
        plain(network.shortcut.bias),
        plain(network.head.weight)[0].copy(),
        float(plain(network.head.bias)[0]),
    )


def tcn_to_onnx(weights: TcnWeights) -> onnx.ModelProto:
    """Return the checked graph over a whole sequence from its start: ``features`` (batch, k, time) to ``hidden``
    (batch, channels, time) and ``head`` (batch, 1, time); all float32."""
    constants = [
        *_parameters("shortcut", weights.shortcut.T[:, :, None], weights.shortcut_bias),
        *_parameters("head", weights.head[None, :, None], np.array([weights.head_bias], dtype=np.float32)),
    ]
    nodes = [helper.make_node("Conv", ["features", "shortcut_weight", "shortcut_bias"], ["residual"])]
    signal, residual = "features", "residual"
    for number, kernel in enumerate(weights.kernels):
        own, dilation = f"convolution{number}", 2 ** (number // 2)
        constants += _parameters(own, kernel[::-1].transpose(2, 1, 0), weights.biases[number])
        names, pads = [signal, own + "_weight", own + "_bias"], [(kernel.shape[0] - 1) * dilation, 0]
        nodes += [
            helper.make_node("Conv", names, [own + "_product"], dilations=[dilation], pads=pads),
            helper.make_node("Relu", [own + "_product"], [own]),
        ]
        signal = own
        if number % 2 == 1:
            block = f"block{number // 2}"
            nodes += [
                helper.make_node("Add", [own, residual], [block + "_sum"]),
                helper.make_node("Relu", [block + "_sum"], [block]),
            ]
            signal = residual = block
    nodes += [
        helper.make_node("Identity", [signal], ["hidden"]),
        helper.make_node("Conv", [signal, "head_weight", "head_bias"], ["head"]),
    ]
    graph = helper.make_graph(
        nodes,
        "tcn",
        [_value("features", ["batch", weights.shortcut.shape[0], "time"])],
        [_value("hidden", ["batch", len(weights.head), "time"]), _value("head", ["batch", 1, "time"])],
        initializer=constants,
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION)
    onnx.checker.check_model(model, full_check=True)
    return model


def tcn_from_onnx(model: onnx.ModelProto) -> TcnWeights:
    """Return the weights inside a graph that ``tcn_to_onnx`` made."""
    stored = {tensor.name: numpy_helper.to_array(tensor) for tensor in model.graph.initializer}
    count = sum(1 for name in stored if name.startswith("convolution") and name.endswith("_weight"))
    kernels = [stored[f"convolution{number}_weight"].transpose(2, 1, 0)[::-1] for number in range(count)]
    return TcnWeights(
        tuple(np.ascontiguousarray(kernel) for kernel in kernels),
        np.stack([stored[f"convolution{number}_bias"] for number in range(count)]),
        np.ascontiguousarray(stored["shortcut_weight"][:, :, 0].T),
        stored["shortcut_bias"],
        np.ascontiguousarray(stored["head_weight"][0, :, 0]),
        float(stored["head_bias"][0]),
    )


def _parameters(name: str, weight: Single, bias: Single) -> list[onnx.TensorProto]:
    return [
        numpy_helper.from_array(np.ascontiguousarray(weight), name + "_weight"),
        numpy_helper.from_array(np.ascontiguousarray(bias), name + "_bias"),
    ]


def _value(name: str, shape: list[int | str]) -> onnx.ValueInfoProto:
    return helper.make_tensor_value_info(name, TensorProto.FLOAT, shape)


class TcnEstimator(SequenceEstimator):
    """A causal TCN that corrects the force balance, or gives all of friction where there are no pressures
    (Bai, Kolter and Koltun 2018).

    ``architecture`` is a ``TcnArchitecture``.
    """

    kind: ClassVar[str] = "tcn"
    architecture_type: ClassVar[type] = TcnArchitecture

    def make_network(self, inputs: int) -> torch.nn.Module:
        from friction_benchmark.models.sequence_networks import TcnNetwork  # PyTorch: training alone waits for it

        size = self.architecture
        return TcnNetwork(inputs, size.levels, size.channels, size.kernel, size.dropout)

    def to_onnx(self, network: Any) -> onnx.ModelProto:
        return tcn_to_onnx(tcn_weights_of(network))

    def from_onnx(self, model: onnx.ModelProto) -> Tcn:
        return Tcn(tcn_from_onnx(model))
