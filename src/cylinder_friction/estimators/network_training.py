"""Training of the LSTM in PyTorch: whole sequences, state carried from one to the next, one target a step."""

from __future__ import annotations

import itertools
import math
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch import nn

from cylinder_friction.estimators.training_plan import LearningCurve
from cylinder_friction.realtime.lstm import LstmWeights

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from cylinder_friction.estimators.checkpoint import Checkpoint
    from cylinder_friction.estimators.training_plan import Architecture, EpochReport, SequenceData, TrainingPlan

TORCH_THREADS = 1
"""At these sizes a second thread costs more than it gives; fixed, sums are added in the same order on every run."""


class FrictionNetwork(nn.Module):
    """LSTM layers with dropout after each, and a linear head that starts at zero."""

    def __init__(self, architecture: Architecture, inputs: int) -> None:
        super().__init__()
        between = architecture.dropout if architecture.layers > 1 else 0.0
        self.lstm = nn.LSTM(inputs, architecture.nodes, architecture.layers, dropout=between)
        self.dropout = nn.Dropout(architecture.dropout)
        self.head = nn.Linear(architecture.nodes, 1)
        nn.init.zeros_(self.head.weight)
        nn.init.zeros_(self.head.bias)

    def forward(self, features: torch.Tensor, state: Any = None) -> tuple[torch.Tensor, Any]:
        """Return the output, shape ``(time, batch)``, and the state, for features ``(time, batch, inputs)``."""
        hidden, state = self.lstm(features, state)
        return self.head(self.dropout(hidden)).squeeze(-1), state


def train_network(
    architecture: Architecture,
    plan: TrainingPlan,
    train: Sequence[SequenceData],
    validation: Sequence[SequenceData],
    seed: int,
    device: str = "cpu",
    checkpoint: Checkpoint | None = None,
    report: EpochReport | None = None,
) -> tuple[LstmWeights, LearningCurve]:
    """Train with Adam (Kingma and Ba 2015) on the mean absolute error, stops early, returns the best epoch's weights.

    Args:
        architecture: Of the network.
        plan: Of the training.
        train: Recordings that are learnt from.
        validation: Recordings that early stopping listens to.
        seed: Each epoch's dropout and order follow from it and the epoch's number alone, so that training resumed
            from a checkpoint ends bit for bit where an undisturbed one ends.
        device: ``cpu`` or ``cuda``.
        checkpoint: Saved after each epoch and picked up at the start.
        report: Called after each epoch with its number, training error and validation error; it may raise to stop.

    Raises:
        FloatingPointError: The error is no longer a number.
    """
    with reproducible(seed):
        return _Training(architecture, plan, train, validation, seed, device, checkpoint, report).run()


class _Training:
    def __init__(
        self,
        architecture: Architecture,
        plan: TrainingPlan,
        train: Sequence[SequenceData],
        validation: Sequence[SequenceData],
        seed: int,
        device: str,
        checkpoint: Checkpoint | None,
        report: EpochReport | None,
    ) -> None:
        self.plan, self.seed, self.device, self.checkpoint, self.report = plan, seed, device, checkpoint, report
        self.rate = architecture.learning_rate
        inputs = train[0].features.shape[1]
        self.network = FrictionNetwork(architecture, inputs).to(device)
        self.optimiser = torch.optim.Adam(self.network.parameters(), lr=self.rate)
        self.train = side_by_side(train, device)
        self.validation = side_by_side(validation, device)
        self.curve = LearningCurve()
        self.best = self._copy()

    def run(self) -> tuple[LstmWeights, LearningCurve]:
        self._resume()
        while len(self.curve.train_mae) < self.plan.epochs and not self._patience_is_over():
            epoch = len(self.curve.train_mae) + 1
            trained = self._train_epoch(epoch)
            validated = self._validate()
            if not math.isfinite(trained + validated):
                raise FloatingPointError(
                    f"epoch {epoch}: mean absolute error is {validated}; lower the learning rate, now {self.rate}"
                )
            if not self.curve.validation_mae or validated < min(self.curve.validation_mae):
                self.best, self.curve.best_epoch = self._copy(), epoch
            self.curve.train_mae.append(trained)
            self.curve.validation_mae.append(validated)
            self._save()
            if self.report is not None:
                self.report(epoch, trained, validated)
        self.network.load_state_dict(self.best)
        return weights_of(self.network), self.curve

    def _patience_is_over(self) -> bool:
        return len(self.curve.train_mae) - self.curve.best_epoch >= self.plan.patience

    def _train_epoch(self, epoch: int) -> float:
        torch.manual_seed(self.seed * 100_003 + epoch)
        generator = np.random.default_rng([self.seed, epoch])
        order = generator.permutation(len(self.train.lengths))
        shift = int(generator.integers(self.plan.sequence_length))
        self.network.train()
        total, count = 0.0, 0.0
        groups = [order[i : i + self.plan.batch_size] for i in range(0, len(order), self.plan.batch_size)]
        for number, group in enumerate(groups):
            self._set_rate((epoch - 1 + number / len(groups)) / self.plan.epochs)
            error, scored = self._train_group(torch.as_tensor(group), shift)
            total, count = total + error, count + scored
        return total / max(count, 1.0)

    def _train_group(self, group: torch.Tensor, shift: int) -> tuple[float, float]:
        length = int(self.train.lengths[group].max())
        edges = [0, *range(shift or self.plan.sequence_length, length, self.plan.sequence_length), length]
        state, total, count = None, 0.0, 0.0
        for start, end in itertools.pairwise(edges):
            features = self.train.features[start:end, group]
            weight = self.train.weight[start:end, group].clone()
            weight[: max(0, self.plan.burn_in - start)] = 0.0
            output, state = self.network(features, state)
            state = tuple(part.detach() for part in state)
            scored = weight.sum()
            if float(scored) == 0.0:
                continue
            error = ((output - self.train.target[start:end, group]).abs() * weight).sum()
            self.optimiser.zero_grad()
            (error / scored).backward()
            nn.utils.clip_grad_norm_(self.network.parameters(), 1.0)
            self.optimiser.step()
            total, count = total + float(error.detach()), count + float(scored)
        return total, count

    def _set_rate(self, progress: float) -> None:
        factor = 1.0 if self.plan.schedule == "constant" else 0.5 * (1.0 + math.cos(math.pi * progress)) + 0.01
        for group in self.optimiser.param_groups:
            group["lr"] = self.rate * factor

    def _validate(self) -> float:
        self.network.eval()
        with torch.no_grad():
            output, _ = self.network(self.validation.features)
        error = ((output - self.validation.target).abs() * self.validation.weight).sum()
        return float(error / self.validation.weight.sum())

    def _copy(self) -> dict[str, torch.Tensor]:
        return {name: value.detach().clone() for name, value in self.network.state_dict().items()}

    def _save(self) -> None:
        if self.checkpoint is None:
            return
        arrays = {f"network/{name}": value.cpu().numpy() for name, value in self.network.state_dict().items()}
        arrays |= {f"best/{name}": value.cpu().numpy() for name, value in self.best.items()}
        for index, moments in self.optimiser.state_dict()["state"].items():
            arrays |= {f"adam/{index}/{name}": value.cpu().numpy() for name, value in moments.items()}
        arrays["train_mae"] = np.array(self.curve.train_mae)
        arrays["validation_mae"] = np.array(self.curve.validation_mae)
        arrays["best_epoch"] = np.array(self.curve.best_epoch)
        self.checkpoint.save(arrays)

    def _resume(self) -> None:
        stored = None if self.checkpoint is None else self.checkpoint.load()
        if stored is None:
            return
        self.network.load_state_dict(_tensors(stored, "network/"))
        self.best = {name: value.to(self.device) for name, value in _tensors(stored, "best/").items()}
        optimiser = self.optimiser.state_dict()
        moments: dict[int, dict[str, torch.Tensor]] = {}
        for name, value in _tensors(stored, "adam/").items():
            index, moment = name.split("/")
            moments.setdefault(int(index), {})[moment] = value
        self.optimiser.load_state_dict({**optimiser, "state": moments})
        self.curve = LearningCurve(
            stored["train_mae"].tolist(), stored["validation_mae"].tolist(), int(stored["best_epoch"])
        )


@dataclass(frozen=True)
class SideBySide:
    """Recordings side by side, padded at the end: features (time, batch, k), target and weight (time, batch)."""

    features: torch.Tensor
    target: torch.Tensor
    weight: torch.Tensor
    lengths: torch.Tensor


def side_by_side(recordings: Sequence[SequenceData], device: str = "cpu") -> SideBySide:
    """Return recordings of any lengths as one batch; what is padded weighs nothing."""
    lengths = torch.tensor([len(recording.target) for recording in recordings])
    time, batch, inputs = int(lengths.max()), len(recordings), recordings[0].features.shape[1]
    features = torch.zeros(time, batch, inputs)
    target, weight = torch.zeros(time, batch), torch.zeros(time, batch)
    for index, recording in enumerate(recordings):
        end = len(recording.target)
        features[:end, index] = torch.from_numpy(recording.features)
        target[:end, index] = torch.from_numpy(recording.target)
        weight[:end, index] = torch.from_numpy(recording.usable.astype(np.float32))
    return SideBySide(features.to(device), target.to(device), weight.to(device), lengths)


def _tensors(stored: dict[str, NDArray[Any]], prefix: str) -> dict[str, torch.Tensor]:
    return {
        name.removeprefix(prefix): torch.from_numpy(value) for name, value in stored.items() if name.startswith(prefix)
    }


@contextmanager
def reproducible(seed: int) -> Iterator[None]:
    """Seeds PyTorch, keeps it to one thread and to deterministic kernels inside the block."""
    threads, deterministic = torch.get_num_threads(), torch.are_deterministic_algorithms_enabled()
    torch.set_num_threads(TORCH_THREADS)
    torch.use_deterministic_algorithms(True, warn_only=True)
    torch.manual_seed(seed)
    try:
        yield
    finally:
        torch.set_num_threads(threads)
        torch.use_deterministic_algorithms(deterministic)


def weights_of(network: FrictionNetwork) -> LstmWeights:
    """Return a network's weights as plain arrays, gates reordered from PyTorch's i, f, g, o to i, o, f, c."""
    lstm, nodes, layers = network.lstm, network.lstm.hidden_size, network.lstm.num_layers
    order = np.concatenate([np.arange(nodes) + nodes * gate for gate in (0, 3, 1, 2)])
    parts = {name: value.detach().cpu().numpy() for name, value in lstm.named_parameters()}
    kernels = [parts[f"weight_ih_l{layer}"][order].T for layer in range(layers)]
    padded = np.zeros((layers, max(len(kernel) for kernel in kernels), 4 * nodes), dtype=np.float32)
    for layer, kernel in enumerate(kernels):
        padded[layer, : len(kernel)] = kernel
    return LstmWeights(
        input=padded,
        recurrent=np.stack([np.ascontiguousarray(parts[f"weight_hh_l{layer}"][order].T) for layer in range(layers)]),
        bias=np.stack([(parts[f"bias_ih_l{n}"] + parts[f"bias_hh_l{n}"])[order] for n in range(layers)]),
        head=network.head.weight.detach().cpu().numpy()[0].copy(),
        head_bias=float(network.head.bias.detach().cpu()[0]),
        inputs=int(lstm.input_size),
    )
