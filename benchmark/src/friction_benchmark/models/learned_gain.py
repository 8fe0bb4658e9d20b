"""A filter of the force balance whose gain a network sets at every step: small where friction is steady, so that noise
is averaged, and large where friction breaks away.

    m[t] = m[t-1] + g[t] (b[t] - m[t-1]),   friction = m[t] + c[t],   b = P1·A1 - P2·A2

This is a Kalman filter of one state, a random walk, with its gain learnt instead of computed (Revach, Shlezinger, Ni,
Escoriza, van Sloun and Eldar 2022, "KalmanNet", IEEE Transactions on Signal Processing 70, where a recurrent network
gives the gain and the filter's structure stays). Chosen here: an LSTM gives the gain's logit and the offset c (which no
gain can give: a sensor's error, delay, a load); it sees no innovation of its own filter, but those of fixed ones, so
that it can be trained over whole sequences.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numba
import numpy as np

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.linear import force_balance_taps
from cylinder_friction.estimators.onnx_files import read_network, write_network
from cylinder_friction.estimators.training_plan import Architecture, SequenceData
from cylinder_friction.realtime.lstm import Lstm, LstmState, head_of, sigmoid
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from friction_benchmark.models.learned import NETWORK_FILE
from friction_benchmark.models.tracking_features import TrackingFeatures, TrackingState

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    import torch
    from numpy.typing import NDArray

    from cylinder_friction.arrays import Array
    from cylinder_friction.realtime.lstm import LstmWeights
    from cylinder_friction.recordings.recording import Recording

    Single = NDArray[np.float32]

LARGE_OFFSET_N = 30.0
"""Mean distance of a recording's friction from its force balance, above which the mean of past strokes helps: about
10 N with zeroed transmitters, 200 N with transmitters as bought."""
FIRST_GAIN_LOGIT = -1.0
"""Start of training: a gain of 0.27, about the best constant one."""
WARM_UP = 0.05
"""Share of training over which the learning rate rises to its maximum."""


@dataclass(frozen=True)
class GainPlan:
    """How the network is trained.

    Attributes:
        presentations: Recordings presented in training, repetitions counted; each is presented at least once.
        learning_rate: Its maximum.
        batch_size: Recordings side by side.
        stretch: Samples between two updates.
        burn_in: First samples of each recording that are not scored.
        weight_decay: Of AdamW.
    """

    presentations: int
    learning_rate: float = 5e-3
    batch_size: int = 32
    stretch: int = 200
    burn_in: int = 100
    weight_decay: float = 1e-3

    def __post_init__(self) -> None:
        if min(self.presentations, self.batch_size, self.stretch) < 1:
            raise ValueError(f"expected presentations, batch size and stretch of at least 1, but got {self}")


@dataclass
class LearnedGainState:
    """State of features and network, and the tracked force [N], shape ``(1,)``, NaN before the first sample."""

    features: TrackingState
    network: LstmState
    tracked_n: Array


class LearnedGainEstimator(FrictionEstimator):
    """The force balance through a filter whose gain an LSTM of one layer sets; it trains to the end of its schedule.

    The mean force balance of the strokes so far, which reveals a sensor's offset, is seen only where offsets are large:
    small ones are hidden by friction's asymmetry, which differs from rig to rig.

    Args:
        cylinder: Its areas.
        nodes: Of the LSTM.
        plan: Of its training.
        inputs: Columns of a sample; both raw pressures and the position come first.
        seed: Seeds weights and batch order.
    """

    kind: ClassVar[str] = "learned_gain"

    def __init__(
        self,
        cylinder: Cylinder,
        nodes: int,
        plan: GainPlan,
        inputs: Sequence[str] = SAMPLE_COLUMNS,
        seed: int = 0,
    ) -> None:
        super().__init__(inputs)
        self.cylinder, self.nodes, self.plan, self.seed = cylinder, nodes, plan, seed
        self.scale_n = 1.0
        self.features: TrackingFeatures | None = None
        self._network: Lstm | None = None
        self._offset_head: Single = np.zeros(nodes, dtype=np.float32)
        self._offset_bias = 0.0

    def fit(self, recordings: Sequence[Recording]) -> Self:
        """Train on the recordings' ``friction_n``: labels, or a simulated rig's true friction.

        Raises:
            FloatingPointError: Training diverged.
            ValueError: The inputs do not begin with both pressures and the position.
        """
        self._begin_fit(recordings)
        seen = _mean_offset_n(self.cylinder, recordings) > LARGE_OFFSET_N
        self.features = TrackingFeatures.of(self.cylinder, recordings, self.inputs, strokes=seen)
        pairs = [self.features.advance(self.features.new_state(), one.samples(self.inputs)) for one in recordings]
        residuals = [
            one.column("friction_n") - balance_n for one, (_, balance_n) in zip(recordings, pairs, strict=True)
        ]
        usable = [residual[one.usable()] for residual, one in zip(residuals, recordings, strict=True)]
        self.scale_n = float(np.concatenate(usable).std()) or 1.0
        sequences = [
            SequenceData(features, (residual / self.scale_n).astype(np.float32), one.usable())
            for one, (features, _), residual in zip(recordings, pairs, residuals, strict=True)
        ]
        balances = [(balance_n / self.scale_n).astype(np.float32) for _, balance_n in pairs]
        weights, self._offset_head, self._offset_bias = _train(self.nodes, self.plan, sequences, balances, self.seed)
        self._network = Lstm(weights)
        return self

    def new_state(self) -> LearnedGainState:
        assert self.features is not None
        assert self._network is not None
        return LearnedGainState(self.features.new_state(), self._network.new_state(), np.full(1, np.nan))

    def advance(self, state: LearnedGainState, samples: Array) -> Array:
        assert self.features is not None
        assert self._network is not None
        features, balance_n = self.features.advance(state.features, samples)
        hidden, logit = self._network.advance(state.network, np.ascontiguousarray(features))
        gain, offset = _heads(hidden, logit, self._offset_head, self._offset_bias)
        return np.asarray(_track(balance_n, gain, state.tracked_n) + self.scale_n * offset)

    def multiply_adds(self) -> int:
        assert self.features is not None
        assert self._network is not None
        return self.features.multiply_adds() + self._network.weights.multiply_adds() + self.nodes + 2

    def _write(self, folder: Path) -> dict[str, Any]:
        assert self.features is not None
        assert self._network is not None
        write_network(self._network.weights, folder / NETWORK_FILE)
        return {
            "cylinder": asdict(self.cylinder),
            "nodes": self.nodes,
            "plan": asdict(self.plan),
            "seed": self.seed,
            "features": self.features.to_dict(),
            "scale_n": self.scale_n,
            "offset_head": self._offset_head.tolist(),
            "offset_bias": self._offset_bias,
        }

    @classmethod
    def _read(cls, folder: Path, parameters: dict[str, Any]) -> Self:
        features = TrackingFeatures.from_dict(parameters["features"])
        estimator = cls(
            Cylinder(**parameters["cylinder"]),
            parameters["nodes"],
            GainPlan(**parameters["plan"]),
            features.plan.inputs,
            parameters["seed"],
        )
        estimator.features, estimator.scale_n = features, parameters["scale_n"]
        estimator._network = Lstm(read_network(folder / NETWORK_FILE))
        estimator._offset_head = np.array(parameters["offset_head"], dtype=np.float32)
        estimator._offset_bias = parameters["offset_bias"]
        return estimator


def _mean_offset_n(cylinder: Cylinder, recordings: Sequence[Recording]) -> float:
    """Return the mean over recordings of |median of friction less force balance| [N], on usable rows."""
    areas = force_balance_taps(cylinder)[0, :, 0]
    offsets = [
        np.median((recording.column("friction_n") - recording.samples() @ areas)[recording.usable()])
        for recording in recordings
        if recording.usable().any()
    ]
    return float(np.mean(np.abs(offsets)))


def _train(
    nodes: int,
    plan: GainPlan,
    sequences: Sequence[SequenceData],
    balances: Sequence[Single],
    seed: int,
) -> tuple[LstmWeights, Single, float]:
    """Train with AdamW (Loshchilov and Hutter 2019) and a cosine schedule on the mean absolute error.

    ``sequences`` hold features, friction less force balance, and mask; ``balances`` the force balance, shape ``(n,)``;
    both in units of the scale. Returns the network with the gain's head, and weights and bias of the offset's head.
    """
    import torch  # only training needs it
    from torch import nn

    from cylinder_friction.estimators.training import FrictionNetwork, reproducible, side_by_side, weights_of

    with reproducible(seed):
        inputs = sequences[0].features.shape[1]
        network = FrictionNetwork(Architecture(1, nodes, 0.0, plan.learning_rate), inputs)
        offset_head = nn.Linear(nodes, 1)
        for layer, bias in ((network.head, FIRST_GAIN_LOGIT), (offset_head, 0.0)):
            nn.init.zeros_(layer.weight)
            nn.init.constant_(layer.bias, bias)
        parameters = [*network.parameters(), *offset_head.parameters()]
        optimiser = torch.optim.AdamW(parameters, lr=plan.learning_rate, weight_decay=plan.weight_decay, fused=True)
        generator = np.random.default_rng(seed)
        groups = math.ceil(len(sequences) / plan.batch_size)
        epochs = max(1, round(plan.presentations / len(sequences)))
        for epoch, number in itertools.product(range(epochs), range(groups)):
            if number == 0:
                order = generator.permutation(len(sequences))
            progress = (epoch + number / groups) / epochs
            cosine = 0.5 * (1.0 + math.cos(math.pi * progress)) + 0.01
            rate = plan.learning_rate * min(1.0, progress / WARM_UP + 0.05) * cosine
            optimiser.param_groups[0]["lr"] = rate
            group = order[number * plan.batch_size : (number + 1) * plan.batch_size]
            batch = side_by_side([sequences[one] for one in group])
            batch.weight[: plan.burn_in] = 0.0
            balance = nn.utils.rnn.pad_sequence([torch.from_numpy(balances[one]) for one in group])
            cut = int(generator.integers(plan.stretch))
            edges = sorted({0, *range(cut, len(balance), plan.stretch), len(balance)})
            state, last, mean = None, balance[0], 0.0
            for start, end in itertools.pairwise(edges):  # state and tracked force carry on, the gradient does not
                hidden, state = network.lstm(batch.features[start:end], state)
                state = tuple(part.detach() for part in state)
                gain, offset = network.head(hidden).sigmoid()[..., 0], offset_head(hidden)[..., 0]
                tracked = track(gain, balance[start:end], last)
                last = tracked[-1].detach()
                weight = batch.weight[start:end]
                if float(weight.sum()) == 0.0:
                    continue
                left = tracked + offset - balance[start:end] - batch.target[start:end]
                error = (left.abs() * weight).sum() / weight.sum()
                optimiser.zero_grad()
                error.backward()
                nn.utils.clip_grad_norm_(parameters, 1.0)
                optimiser.step()
                mean = float(error.detach())
            if not math.isfinite(mean):
                raise FloatingPointError(
                    f"epoch {epoch + 1}: mean absolute error is {mean}; lower the learning rate, now {rate}"
                )
        head = offset_head.weight.detach().numpy()[0].copy()
        return weights_of(network), head, float(offset_head.bias.detach()[0])


def track(gain: torch.Tensor, balance: torch.Tensor, last: torch.Tensor) -> torch.Tensor:
    """Return the tracked force, shape ``(time, batch)``, after ``last``, ``(batch,)``; differentiable by the gain.

    A parallel scan (Hillis and Steele 1986): after each pass a row holds the filter over twice as many steps.
    """
    import torch

    kept, tracked = 1.0 - gain, gain * balance
    tracked = torch.cat([tracked[:1] + kept[:1] * last, tracked[1:]])
    span = 1
    while span < len(kept):
        tracked = torch.cat([tracked[:span], tracked[span:] + kept[span:] * tracked[:-span]])
        kept = torch.cat([kept[:span], kept[span:] * kept[:-span]])
        span *= 2
    return tracked


@numba.njit(cache=True)
def _heads(hidden: Single, logit: Single, offset_head: Single, offset_bias: float) -> tuple[Array, Array]:
    """Return gain and offset, float64, of each step of the network."""
    gain, offset = np.empty(len(logit)), np.empty(len(logit))
    for row in range(len(logit)):
        gain[row] = sigmoid(logit[row])
        offset[row] = head_of(hidden[row], offset_head, offset_bias)
    return gain, offset


@numba.njit(cache=True)
def _track(balance_n: Array, gain: Array, tracked_n: Array) -> Array:
    """Return the tracked force [N]; it begins at the first force balance."""
    result = np.empty_like(balance_n)
    for row in range(len(balance_n)):
        if np.isnan(tracked_n[0]):
            tracked_n[0] = balance_n[row]
        tracked_n[0] += gain[row] * (balance_n[row] - tracked_n[0])
        result[row] = tracked_n[0]
    return result
