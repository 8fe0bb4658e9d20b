"""The networks that are trained in PyTorch; only training imports this."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import torch
from torch import nn
from torch.nn.functional import conv1d, relu
from torch.nn.utils.parametrizations import weight_norm

if TYPE_CHECKING:
    from cylinder_friction.estimators.training_plan import Architecture


class GruNetwork(nn.Module):
    """GRU layers with dropout after each, and a linear head that starts at zero."""

    def __init__(self, architecture: Architecture, inputs: int) -> None:
        super().__init__()
        between = architecture.dropout if architecture.layers > 1 else 0.0
        self.gru = nn.GRU(inputs, architecture.nodes, architecture.layers, dropout=between)
        self.dropout = nn.Dropout(architecture.dropout)
        self.head = _zero_head(architecture.nodes)

    def forward(self, features: torch.Tensor, state: Any = None) -> tuple[torch.Tensor, Any]:
        """Return the output, shape ``(time, batch)``, and the state, for features ``(time, batch, inputs)``."""
        hidden, state = self.gru(features, state)
        return self.head(self.dropout(hidden)).squeeze(-1), state


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
        """Take signals of shape ``(batch, inputs, time)``; returns ``(batch, channels, time)``, and their tail."""
        if before is None:
            before = signal.new_zeros(signal.shape[0], signal.shape[1], self.tail)
        joined = torch.cat([before, signal], dim=2)
        weight, bias = self.convolution.weight, self.convolution.bias
        return conv1d(joined, weight, bias, dilation=self.dilation), joined[:, :, joined.shape[2] - self.tail :]


class TcnNetwork(nn.Module):
    """Residual blocks of two causal convolutions each, dilation doubling, and a linear head that starts at zero."""

    def __init__(self, inputs: int, levels: int, channels: int, kernel: int, dropout: float) -> None:
        super().__init__()
        self.levels = levels
        widths = [inputs] + [channels] * (2 * levels - 1)
        self.convolutions = nn.ModuleList(
            CausalConvolution(width, channels, kernel, 2 ** (number // 2)) for number, width in enumerate(widths)
        )
        self.dropout = nn.Dropout1d(dropout)
        self.shortcut = nn.Linear(inputs, channels)
        self.head = _zero_head(channels)

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


def _zero_head(nodes: int) -> nn.Linear:
    head = nn.Linear(nodes, 1)
    nn.init.zeros_(head.weight)
    nn.init.zeros_(head.bias)
    return head
