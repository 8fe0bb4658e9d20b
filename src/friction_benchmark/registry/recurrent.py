"""What the networks with memory share: the space that is tuned, and how effort becomes a training plan.

Where raw pressures are there, a network corrects a force balance whose error changes within a few samples, so it steps
at every sample: an LSTM after 10 epochs is 1.43 % wrong on the held-out sessions of the default campaign (identity),
and 1.76 % if it steps at every fourth sample. Without them friction depends on how the piston moved for many seconds:
a recurrent network steps at every fourth sample and a TCN at every tenth, and the time that this saves goes into
epochs, which bring more. Effort cuts the epochs, and the rows that a forest is fitted on; deeper stacks get fewer
epochs in proportion.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from cylinder_friction.estimators.training_plan import Architecture
from friction_benchmark.models.sequence_estimator import SequencePlan
from friction_benchmark.registry.model import OneOf, Range, needs_raw_pressures

if TYPE_CHECKING:
    from friction_benchmark.registry.model import BuildConfiguration, Space, Values

RECURRENT_STRIDE = 4
SPACE: Space = {
    "layers": OneOf((1, 2)),
    "nodes": Range(16, 48, logarithmic=True, integer=True),
    "learning_rate": Range(4e-3, 3e-2, logarithmic=True),
    "dropout": OneOf((0.0, 0.05, 0.1)),
}
DEFAULTS: Values = {"layers": 1, "nodes": 32, "learning_rate": 1e-2, "dropout": 0.05}


def architecture(build: BuildConfiguration) -> Architecture:
    return Architecture(
        build.whole("layers"), build.whole("nodes"), build.number("dropout"), build.number("learning_rate")
    )


def sequence_plan(
    build: BuildConfiguration, epochs: int, steps: int, batch_size: int = 16, stride: int = RECURRENT_STRIDE
) -> SequencePlan:
    """Return the plan of this effort.

    Args:
        build: The configuration; its ``layers``, if it has any, share the epochs.
        epochs: At effort 1, with one layer, at every sample.
        steps: Of one training sequence.
        batch_size: Sequences in a batch.
        stride: Samples per step where there are no raw pressures.
    """
    stride = 1 if needs_raw_pressures(build.inputs) else stride
    layers = int(build.hyperparameters.get("layers", 1))
    epochs = max(1, round(build.effort * epochs * stride / layers))
    return SequencePlan(epochs, epochs, steps, batch_size, stride)
