"""What the networks with memory share: the space that is tuned, and how effort becomes a training plan.

Hybrid and LSTM are the product's own, with a step at every sample. GRU and TCN step at every sample where raw pressures
are inputs, because they correct a force balance whose error changes within a few samples. Without raw pressures
friction depends on how the piston moved for many seconds: a GRU steps at every fourth sample and a TCN at every tenth,
and the time that this saves goes into epochs, which bring more. Effort cuts the epochs, and the rows that a forest is
fitted on; deeper stacks get fewer epochs in proportion.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from cylinder_friction.estimators.training_plan import Architecture, TrainingPlan
from friction_benchmark.registry.model import OneOf, Range, needs_raw_pressures

if TYPE_CHECKING:
    from friction_benchmark.registry.model import BuildConfiguration, Space, Values

RECURRENT_STRIDE = 4
PRESSURE_FREE_EPOCHS = 2
"""Factor on the epochs of hybrid and LSTM where there are no raw pressures."""
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


def training_plan(
    build: BuildConfiguration, epochs: int, steps: int, batch_size: int = 16, slower: int = RECURRENT_STRIDE
) -> TrainingPlan:
    """Return the plan of this effort: all epochs on all recordings, none held out for early stopping.

    Args:
        build: The configuration; its ``layers``, if it has any, share the epochs.
        epochs: At effort 1, with one layer, with raw pressures.
        steps: Of one training sequence.
        batch_size: Sequences in a batch.
        slower: Factor on the epochs where there are no raw pressures.
    """
    factor = 1 if needs_raw_pressures(build.inputs) else slower
    layers = int(build.hyperparameters.get("layers", 1))
    count = max(1, round(build.effort * epochs * factor / layers))
    return TrainingPlan(count, None, steps, 0, batch_size, warm_up=0.05, weight_decay=1e-3)


def stride(build: BuildConfiguration, without_pressures: int = RECURRENT_STRIDE) -> int:
    """Return the samples between two steps of a network."""
    return 1 if needs_raw_pressures(build.inputs) else without_pressures
