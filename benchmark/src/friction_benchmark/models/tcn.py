"""The causal temporal convolutional network (Bai, Kolter and Koltun 2018).

Block (their figure 1): two causal convolutions, dilation 1, 2, 4, ... from block to block, each with weight
normalisation, ReLU and spatial dropout; the block's input is added and goes through ReLU once more. The first block's
input goes through a 1×1 convolution, because it has another width. Before the first sample every layer sees zeros.
"""

import math
from functools import partial
from typing import Any

import torch
from torch import nn
from torch.nn.functional import conv1d, relu
from torch.nn.utils.parametrizations import weight_norm

from friction_benchmark.models.sequence_network import SequenceModel, training_plan, zero_head
from friction_benchmark.registry import BuildConfiguration, Float, Int, OneOf, RegisteredModel


class CausalConvolution(nn.Module):
    """A dilated convolution with weight normalisation; its state is the end of what it saw, zero at first."""

    def __init__(self, inputs: int, channels: int, kernel: int, dilation: int) -> None:
        super().__init__()
        self.tail, self.dilation = (kernel - 1) * dilation, dilation
        convolution = nn.Conv1d(inputs, channels, kernel, dilation=dilation)
        nn.init.kaiming_normal_(convolution.weight, nonlinearity="relu")
        nn.init.zeros_(convolution.bias)  # type: ignore[arg-type]
        self.convolution = weight_norm(convolution)

    def forward(self, signal: torch.Tensor, before: torch.Tensor | None) -> tuple[torch.Tensor, torch.Tensor]:
        """Take signals of shape ``(batch, inputs, time)``; return ``(batch, channels, time)``, and their tail."""
        if before is None:
            before = signal.new_zeros(signal.shape[0], signal.shape[1], self.tail)
        joined = torch.cat([before, signal], dim=2)
        weight, bias = self.convolution.weight, self.convolution.bias
        return conv1d(joined, weight, bias, dilation=self.dilation), joined[:, :, joined.shape[2] - self.tail :]


class TcnNetwork(nn.Module):
    """Residual blocks of two causal convolutions each, dilation doubling, and a linear head that starts at zero."""

    def __init__(self, levels: int, channels: int, kernel: int, dropout: float, inputs: int) -> None:
        super().__init__()
        self.levels = levels
        widths = [inputs] + [channels] * (2 * levels - 1)
        self.convolutions = nn.ModuleList(
            CausalConvolution(width, channels, kernel, 2 ** (number // 2)) for number, width in enumerate(widths)
        )
        self.dropout = nn.Dropout1d(dropout)
        self.shortcut = nn.Linear(inputs, channels)
        self.head = zero_head(channels)

    def forward(self, features: torch.Tensor, state: Any = None) -> tuple[torch.Tensor, Any]:
        """Return the output, shape ``(time, batch)``, and the state, for features ``(time, batch, inputs)``."""
        before = (None,) * len(self.convolutions) if state is None else state
        tails = []
        signal, residual = features.permute(1, 2, 0), self.shortcut(features).permute(1, 2, 0)
        for level in range(self.levels):
            inner = signal
            for number in (2 * level, 2 * level + 1):
                inner, tail = self.convolutions[number](inner, before[number])
                inner = self.dropout(relu(inner))
                tails.append(tail)
            signal = residual = relu(inner + residual)
        return self.head(signal.permute(2, 0, 1)).squeeze(-1), tuple(tails)


def levels_for(steps: int, kernel: int) -> int:
    """Return how many blocks an output needs to depend on so many steps, the present one included."""
    return math.ceil(math.log2(1.0 + (steps - 1) / (2 * (kernel - 1))))


def _build(build: BuildConfiguration) -> SequenceModel:
    kernel = build.whole("kernel")
    levels = levels_for(build.whole("receptive_field_steps"), kernel)
    network = partial(TcnNetwork, levels, build.whole("channels"), kernel, build.number("dropout"))
    return SequenceModel(build, network, training_plan(build, epochs=24, steps=100, slower=10), stride=10)


MODELS = (
    RegisteredModel(
        name="tcn",
        title="Causal TCN",
        family="modern",
        source="Bai, Kolter and Koltun 2018",
        build=_build,
        space={
            "receptive_field_steps": (OneOf((128, 256, 512)), 128),
            "kernel": (OneOf((3, 4)), 4),
            "channels": (Int(8, 20), 16),
            "learning_rate": (Float(2e-3, 2e-2, log=True), 1e-2),
            "dropout": (OneOf((0.0, 0.05)), 0.0),
        },
        chosen="As many blocks as the receptive field needs: at least 128 steps, 0.64 s or, without pressures, 6.4 s; "
        "weight normalisation, spatial dropout.",
    ),
)
