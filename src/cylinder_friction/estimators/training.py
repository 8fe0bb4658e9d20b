"""Training of sequence networks in PyTorch: recordings are the batch, with one target per step.

The state is carried from one stretch of a recording to the next, the gradient is not (truncated backpropagation through
time; Williams and Peng 1990).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from cylinder_friction.estimators.training_plan import (
    Architecture,
    Checkpoint,
    EpochReport,
    SequenceData,
    TrainingCurve,
    TrainingPlan,
)
from cylinder_friction.realtime.lstm import LstmWeights

TORCH_THREADS = 1
"""At these sizes a second thread slows training down. A fixed number adds sums in the same order on every run."""


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
        """Compute the output, shape ``(time, batch)``, and the state, from features ``(time, batch, inputs)``."""
        hidden, state = self.lstm(features, state)
        return self.head(self.dropout(hidden)).squeeze(-1), state


def train_network(
    make_network: Callable[[int], nn.Module],
    learning_rate: float,
    plan: TrainingPlan,
    train: Sequence[SequenceData],
    validation: Sequence[SequenceData] = (),
    seed: int = 0,
    device: str = "cpu",
    checkpoint: Checkpoint | None = None,
    report: EpochReport | None = None,
    stride: int = 1,
) -> tuple[Any, TrainingCurve]:
    """Train on the mean absolute error with Adam (Kingma and Ba 2015); return the network of the best epoch.

    Without validation recordings, return the network of the last epoch.

    Args:
        make_network: Takes the number of features, returns ``(features, state) -> (output, state)``: features
            ``(time, batch, k)``, output ``(time, batch)``, state None at first, else nested tuples of tensors.
        learning_rate: The highest learning rate of the schedule.
        plan: Epochs, batches and schedule.
        train: Recordings to learn from.
        validation: Recordings that stop training early and choose the epoch.
        seed: Seeds dropout and order, together with the epoch's number alone, so that a training resumed from a
            checkpoint gives the same bits as an uninterrupted one.
        device: ``cpu`` or ``cuda``.
        checkpoint: Saved after each epoch, and read at the start to resume.
        report: Called after each epoch with its number, training error and validation error; it may raise to stop.
        stride: Samples between two steps of the network. A step's target is the mean over those samples. Each epoch
            begins at another random sample among them.

    Raises:
        FloatingPointError: The error became NaN or infinite.
    """
    with reproducible(seed, device):
        network = make_network(train[0].features.shape[1]).to(device)
        training = _Training(network, learning_rate, plan, train, validation, seed, device, checkpoint, report, stride)
        return network.eval(), training.run()


class _Training:
    def __init__(
        self,
        network: nn.Module,
        rate: float,
        plan: TrainingPlan,
        train: Sequence[SequenceData],
        validation: Sequence[SequenceData],
        seed: int,
        device: str,
        checkpoint: Checkpoint | None,
        report: EpochReport | None,
        stride: int,
    ) -> None:
        self.plan, self.seed, self.device, self.checkpoint, self.report = plan, seed, device, checkpoint, report
        self.network, self.rate, self.stride = network, rate, stride
        self.optimiser = torch.optim.AdamW(network.parameters(), lr=rate, weight_decay=plan.weight_decay)
        self.train = side_by_side(train, device)
        self.validation = strided(side_by_side(validation, device), stride, 0) if validation else None
        self.curve = TrainingCurve()
        self.best = self._copy()

    def run(self) -> TrainingCurve:
        self._resume()
        curve = self.curve
        while len(curve.train_mae) < self.plan.epochs and not self._patience_is_over():
            epoch = len(curve.train_mae) + 1
            trained = self._train_epoch(epoch)
            validated = math.nan if self.validation is None else self._validate(self.validation)
            error = trained if self.validation is None else trained + validated
            if not math.isfinite(error):
                raise FloatingPointError(
                    f"epoch {epoch}: mean absolute error is {error}; lower the learning rate, now {self.rate}"
                )
            if self.validation is None or not curve.validation_mae or validated < min(curve.validation_mae):
                self.best, curve.best_epoch = self._copy(), epoch
            curve.train_mae.append(trained)
            if self.validation is not None:
                curve.validation_mae.append(validated)
            self._save()
            if self.report is not None:
                self.report(epoch, trained, validated)
        self.network.load_state_dict(self.best)
        return curve

    def _patience_is_over(self) -> bool:
        since_best = len(self.curve.train_mae) - self.curve.best_epoch
        return self.plan.patience is not None and since_best >= self.plan.patience

    def _train_epoch(self, epoch: int) -> float:
        torch.manual_seed(self.seed * 100_003 + epoch)
        generator = np.random.default_rng([self.seed, epoch])
        order = generator.permutation(len(self.train.lengths))
        shift = int(generator.integers(self.plan.sequence_length))
        phase = 0 if self.stride == 1 else int(generator.integers(self.stride))
        data = strided(self.train, self.stride, phase)
        self.network.train()
        total, count = 0.0, 0.0
        groups = [order[i : i + self.plan.batch_size] for i in range(0, len(order), self.plan.batch_size)]
        for number, group in enumerate(groups):
            self._set_rate((epoch - 1 + number / len(groups)) / self.plan.epochs)
            error, scored = self._train_group(data, torch.as_tensor(group), shift)
            total, count = total + error, count + scored
        return total / max(count, 1.0)

    def _train_group(self, data: SideBySide, group: torch.Tensor, shift: int) -> tuple[float, float]:
        length = int(data.lengths[group].max())
        edges = [0, *range(shift or self.plan.sequence_length, length, self.plan.sequence_length), length]
        state, total, count = None, 0.0, 0.0
        for start, end in itertools.pairwise(edges):
            features = data.features[start:end, group]
            weight = data.weight[start:end, group].clone()
            weight[: max(0, self.plan.burn_in - start)] = 0.0
            output, state = self.network(features, state)
            state = _detached(state)
            scored = weight.sum()
            if float(scored) == 0.0:
                continue
            error = ((output - data.target[start:end, group]).abs() * weight).sum()
            self.optimiser.zero_grad()
            (error / scored).backward()
            nn.utils.clip_grad_norm_(self.network.parameters(), 1.0)
            self.optimiser.step()
            total, count = total + float(error.detach()), count + float(scored)
        return total, count

    def _set_rate(self, progress: float) -> None:
        factor = 1.0 if self.plan.schedule == "constant" else 0.5 * (1.0 + math.cos(math.pi * progress)) + 0.01
        if progress < self.plan.warm_up:
            factor = 0.01 + 0.99 * progress / self.plan.warm_up
        for group in self.optimiser.param_groups:
            group["lr"] = self.rate * factor

    def _validate(self, validation: SideBySide) -> float:
        self.network.eval()
        with torch.no_grad():
            output, _ = self.network(validation.features)
        error = ((output - validation.target).abs() * validation.weight).sum()
        return float(error / validation.weight.sum())

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
        self.curve = TrainingCurve(
            stored["train_mae"].tolist(), stored["validation_mae"].tolist(), int(stored["best_epoch"])
        )


@dataclass(frozen=True)
class SideBySide:
    """Recordings side by side, padded at the end: features (time, batch, k), target and weight (time, batch)."""

    features: torch.Tensor
    target: torch.Tensor
    weight: torch.Tensor
    lengths: torch.Tensor


def device_from(choice: str) -> str:
    """Choose ``cuda`` or ``cpu``; ``auto`` takes CUDA if there is one.

    Raises:
        RuntimeError: ``cuda`` was asked for and there is none.
    """
    available = torch.cuda.is_available()
    if choice == "cuda" and not available:
        raise RuntimeError("device is 'cuda', but PyTorch finds no CUDA device; use 'auto' or 'cpu'")
    return "cuda" if choice != "cpu" and available else "cpu"


def side_by_side(recordings: Sequence[SequenceData], device: str = "cpu") -> SideBySide:
    """Stack recordings of any lengths into one batch; the padding has no weight."""
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


def strided(rows: SideBySide, stride: int, phase: int) -> SideBySide:
    """Keep every ``stride``-th row after the first ``phase``; its target is the weighted mean until the next."""
    if stride == 1:
        return rows
    steps = (rows.target.shape[0] - phase) // stride
    end = phase + steps * stride
    target, weight = (part[phase:end].reshape(steps, stride, -1) for part in (rows.target, rows.weight))
    held = weight.sum(dim=1)
    mean = (target * weight).sum(dim=1) / held.clamp(min=1.0)
    return SideBySide(rows.features[phase:end:stride], mean, held, (rows.lengths - phase) // stride)


def _detached(state: Any) -> Any:
    return state.detach() if isinstance(state, torch.Tensor) else tuple(_detached(part) for part in state)


def _tensors(stored: dict[str, NDArray[Any]], prefix: str) -> dict[str, torch.Tensor]:
    return {
        name.removeprefix(prefix): torch.from_numpy(value) for name, value in stored.items() if name.startswith(prefix)
    }


@contextmanager
def reproducible(seed: int, device: str = "cpu") -> Iterator[None]:
    """Seed PyTorch and keep it to one thread and to deterministic kernels inside the block."""
    threads, deterministic = torch.get_num_threads(), torch.are_deterministic_algorithms_enabled()
    torch.set_num_threads(TORCH_THREADS)
    if device != "cpu":  # on one CPU thread all kernels are deterministic, and the call imports PyTorch's compiler
        torch.use_deterministic_algorithms(True, warn_only=True)
    torch.manual_seed(seed)
    try:
        yield
    finally:
        torch.set_num_threads(threads)
        if device != "cpu":
            torch.use_deterministic_algorithms(deterministic)


def weights_of(network: FrictionNetwork) -> LstmWeights:
    """Copy a network's weights to plain arrays, gates reordered from PyTorch's i, f, g, o to i, o, f, c."""
    lstm, nodes, layers = network.lstm, network.lstm.hidden_size, network.lstm.num_layers
    order = np.concatenate([np.arange(nodes) + nodes * gate for gate in (0, 3, 1, 2)])
    parts = {name: value.detach().cpu().numpy() for name, value in lstm.named_parameters()}
    return LstmWeights.of(
        [parts[f"weight_ih_l{layer}"][order].T for layer in range(layers)],
        [parts[f"weight_hh_l{layer}"][order].T for layer in range(layers)],
        [(parts[f"bias_ih_l{layer}"] + parts[f"bias_hh_l{layer}"])[order] for layer in range(layers)],
        network.head.weight.detach().cpu().numpy()[0].copy(),
        float(network.head.bias.detach().cpu()[0]),
    )


def network_from(architecture: Architecture, weights: LstmWeights, places: Sequence[int | None]) -> FrictionNetwork:
    """Build a network from plain weights: the inverse of ``weights_of``.

    Args:
        architecture: Architecture of the new network and of the weights.
        weights: The weights to begin with.
        places: For each feature, its place among those of ``weights``; None: a new feature, without influence at first.
    """
    network, nodes = FrictionNetwork(architecture, len(places)), weights.nodes
    order = np.concatenate([np.arange(nodes) + nodes * gate for gate in (0, 2, 3, 1)])  # from i, o, f, c
    none = np.zeros(4 * nodes, dtype=np.float32)
    first = np.stack([none if place is None else weights.input[0, place] for place in places])
    state = {"head.weight": weights.head[None], "head.bias": np.array([weights.head_bias])}
    for layer in range(weights.layers):
        kernel = first if layer == 0 else weights.input[layer, :nodes]
        state[f"lstm.weight_ih_l{layer}"] = kernel[:, order].T
        state[f"lstm.weight_hh_l{layer}"] = weights.recurrent[layer][:, order].T
        state[f"lstm.bias_ih_l{layer}"], state[f"lstm.bias_hh_l{layer}"] = weights.bias[layer][order], none
    network.load_state_dict({name: torch.tensor(value, dtype=torch.float32) for name, value in state.items()})
    return network
