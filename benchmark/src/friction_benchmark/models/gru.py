"""The gated recurrent unit (Cho et al. 2014, with the reset gate after the recurrent product, as PyTorch has it)."""

from functools import partial
from typing import Any

import torch
from torch import nn

from cylinder_friction.estimators.training_plan import Architecture
from friction_benchmark.models.sequence_network import SPACE, SequenceModel, architecture, training_plan, zero_head
from friction_benchmark.registry import BuildConfiguration, RegisteredModel


class GruNetwork(nn.Module):
    """GRU layers with dropout after each, and a linear head that starts at zero."""

    def __init__(self, architecture: Architecture, inputs: int) -> None:
        super().__init__()
        between = architecture.dropout if architecture.layers > 1 else 0.0
        self.gru = nn.GRU(inputs, architecture.nodes, architecture.layers, dropout=between)
        self.dropout = nn.Dropout(architecture.dropout)
        self.head = zero_head(architecture.nodes)

    def forward(self, features: torch.Tensor, state: Any = None) -> tuple[torch.Tensor, Any]:
        """Return the output, shape ``(time, batch)``, and the state, for features ``(time, batch, inputs)``."""
        hidden, state = self.gru(features, state)
        return self.head(self.dropout(hidden)).squeeze(-1), state


def _build(build: BuildConfiguration) -> SequenceModel:
    plan = training_plan(build, epochs=24, steps=75, batch_size=32)
    return SequenceModel(build, partial(GruNetwork, architecture(build)), plan)


MODELS = (
    RegisteredModel(
        name="gru",
        title="GRU",
        family="modern",
        source="Cho et al. 2014",
        build=_build,
        space=SPACE,
        chosen="Reset gate after the recurrent product; linear head; mean absolute error, AdamW, cosine.",
    ),
)
