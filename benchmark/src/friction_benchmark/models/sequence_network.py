"""What GRU and TCN share, and how effort becomes a training plan for all networks with memory.

Hybrid and LSTM are the product's own and step at every sample. GRU and TCN step at every sample when raw pressures are
inputs, because they correct a force balance whose error changes within a few samples. Without raw pressures friction
depends on how the piston moved for many seconds: a GRU then steps at every fourth sample and a TCN at every tenth, and
the time that this saves goes into epochs. Effort cuts the epochs, and the rows that a forest is fitted on; deeper
stacks get fewer epochs in proportion.
"""

from collections.abc import Callable, Sequence

import numpy as np
import torch
from torch import nn

from cylinder_friction.estimators.training import train_network
from cylinder_friction.estimators.training_plan import Architecture, SequenceData, TrainingPlan
from friction_benchmark.models.base import FeatureModel, Single
from friction_benchmark.models.training import weights_in
from friction_benchmark.registry import BuildConfiguration, Float, Int, OneOf, Space, needs_raw_pressures

RECURRENT_STRIDE = 4
PRESSURE_FREE_EPOCHS = 2  # Factor on the epochs of hybrid and LSTM without raw pressures
SPACE: Space = {
    "layers": (OneOf((1, 2)), 1),
    "nodes": (Int(16, 48, log=True), 32),
    "learning_rate": (Float(4e-3, 3e-2, log=True), 1e-2),
    "dropout": (OneOf((0.0, 0.05, 0.1)), 0.05),
}


class SequenceModel(FeatureModel):
    """A network over the sequence of features. It may step at every ``stride``-th sample and hold its output between.

    The features and the force balance that it corrects keep the sensors' rate, so only the correction is held; with raw
    pressures it steps at every sample. ``make_network`` returns the network for a number of features: ``(features,
    state) -> (output, state)``, time first, None the first state.
    """

    def __init__(
        self,
        build: BuildConfiguration,
        make_network: Callable[[int], nn.Module],
        plan: TrainingPlan,
        stride: int = RECURRENT_STRIDE,
    ) -> None:
        super().__init__(build)
        self.make_network, self.plan = make_network, plan
        self.stride = 1 if needs_raw_pressures(build.inputs) else stride

    def learn(self, train: Sequence[SequenceData]) -> None:
        rate, seed, stride = self.build.number("learning_rate"), self.seed, self.stride
        network, _ = train_network(self.make_network, rate, self.plan, train, seed=seed, stride=stride)
        self.network: nn.Module = network.eval()

    def predict(self, features: Single) -> Single:
        with torch.inference_mode():
            steps, _ = self.network(torch.from_numpy(features[:: self.stride].copy())[:, None])
        return np.repeat(steps[:, 0].numpy(), self.stride)[: len(features)]

    def model_multiply_adds(self) -> int:
        """Return those of a sample at which the network steps: the most that a sample costs."""
        return weights_in(self.network)


def zero_head(nodes: int) -> nn.Linear:
    """Return a linear output that starts at zero."""
    head = nn.Linear(nodes, 1)
    nn.init.zeros_(head.weight)
    nn.init.zeros_(head.bias)
    return head


def architecture(build: BuildConfiguration) -> Architecture:
    return Architecture(
        build.whole("layers"), build.whole("nodes"), build.number("dropout"), build.number("learning_rate")
    )


def training_plan(
    build: BuildConfiguration, epochs: int, steps: int, batch_size: int = 16, slower: int = RECURRENT_STRIDE
) -> TrainingPlan:
    """Return the plan of this effort: all epochs on all recordings, none held out for early stopping.

    ``epochs`` are those of effort 1, with one layer, with raw pressures; ``slower`` is a factor on them without raw
    pressures. Training sequences have ``steps`` steps.
    """
    factor = 1 if needs_raw_pressures(build.inputs) else slower
    layers = int(build.hyperparameters.get("layers", 1))
    count = max(1, round(build.effort * epochs * factor / layers))
    return TrainingPlan(count, None, steps, 0, batch_size, warm_up=0.05, weight_decay=1e-3)
