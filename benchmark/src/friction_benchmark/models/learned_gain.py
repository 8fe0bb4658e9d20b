"""A filter of the force balance whose gain a network sets at every step: small where friction is steady, so that noise
is averaged, and large where friction breaks away.

    m[t] = m[t-1] + g[t] (b[t] - m[t-1]),   friction = m[t] + c[t],   b = P1·A1 - P2·A2

This is a Kalman filter of one state, a random walk, with its gain learnt instead of computed (Revach, Shlezinger, Ni,
Escoriza, van Sloun and Eldar 2022, "KalmanNet", IEEE Transactions on Signal Processing 70). Chosen here: an LSTM gives
the gain's logit and the offset c (which no gain can give: a sensor's error, delay, a load); it sees no innovation of
its own filter, but those of fixed ones, so that it can be trained over whole sequences.
"""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, Self

import numpy as np
import torch
from torch import nn

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.linear import force_balance_taps
from cylinder_friction.estimators.training import reproducible, side_by_side
from cylinder_friction.estimators.training_plan import SequenceData
from cylinder_friction.recordings.recording import Recording
from friction_benchmark.models.base import Model, Single
from friction_benchmark.models.tracking_features import TrackingFeatures
from friction_benchmark.models.training import minimise, weights_in
from friction_benchmark.registry import BuildConfiguration, Float, OneOf, RegisteredModel, needs_raw_pressures

LARGE_OFFSET_N = 30.0
"""Mean distance of a recording's friction from its force balance, above which the mean of past strokes helps: about
10 N with zeroed transmitters, 200 N with transmitters as bought."""
FIRST_GAIN_LOGIT = -1.0  # Start of training: a gain of 0.27, about the best constant one
BATCH_SIZE, STRETCH, BURN_IN = 32, 200, 100
"""Recordings side by side, samples between two updates, and first samples that are not scored."""


class GainNetwork(nn.Module):
    """An LSTM of one layer, and a head for the gain's logit and the offset."""

    def __init__(self, inputs: int, nodes: int) -> None:
        super().__init__()
        self.lstm, self.head = nn.LSTM(inputs, nodes), nn.Linear(nodes, 2)
        nn.init.zeros_(self.head.weight)
        with torch.no_grad():
            self.head.bias.copy_(torch.tensor([FIRST_GAIN_LOGIT, 0.0]))

    def forward(self, features: torch.Tensor, state: Any = None) -> tuple[torch.Tensor, torch.Tensor, Any]:
        """Return gain and offset, shape ``(time, batch)`` each, and the state."""
        hidden, state = self.lstm(features, state)
        logit, offset = self.head(hidden).unbind(-1)
        return logit.sigmoid(), offset, state


class LearnedGain(Model):
    """The force balance through a filter whose gain an LSTM of one layer sets; it trains to the end of its schedule.

    The mean force balance of the strokes so far, which reveals a sensor's offset, is seen only where offsets are large:
    small ones are hidden by friction's asymmetry, which differs from rig to rig. Effort cuts how many recordings
    training goes through, repetitions counted; each is presented at least once.
    """

    features: TrackingFeatures  # Set by ``fit``, as the network is
    network: GainNetwork

    def __init__(self, build: BuildConfiguration) -> None:
        super().__init__(build.inputs)
        self.build, self.presentations, self.scale_n = build, build.share(3_000), 1.0

    def fit(self, recordings: Sequence[Recording]) -> Self:
        """Train on the recordings' ``friction_n``: labels, or a simulated rig's true friction."""
        cylinder = self.build.cylinder
        seen = _mean_offset_n(cylinder, recordings) > LARGE_OFFSET_N
        self.features = TrackingFeatures(cylinder, recordings, self.inputs, strokes=seen)
        pairs = [self.features.of(one) for one in recordings]
        missed = [one.column("friction_n") - balance_n for one, (_, balance_n) in zip(recordings, pairs, strict=True)]
        usable = [each[one.usable()] for each, one in zip(missed, recordings, strict=True)]
        self.scale_n = float(np.concatenate(usable).std()) or 1.0
        sequences = [
            SequenceData(features, (each / self.scale_n).astype(np.float32), one.usable())
            for one, (features, _), each in zip(recordings, pairs, missed, strict=True)
        ]
        balances = [(balance_n / self.scale_n).astype(np.float32) for _, balance_n in pairs]
        with reproducible(self.build.seed):
            self.network = GainNetwork(sequences[0].features.shape[1], self.build.whole("nodes"))
            losses, rate = self._losses(sequences, balances), self.build.number("learning_rate")
            minimise(self.network.parameters(), losses, rate, weight_decay=1e-3, warm_up=0.05)
        return self

    def estimate(self, recording: Recording) -> Array:
        features, balance_n = self.features.of(recording)
        with torch.inference_mode():
            gain, offset, _ = self.network(torch.from_numpy(features)[:, None])
        tracked = [float(balance_n[0])]
        for share, balance in zip(gain[1:, 0].tolist(), balance_n[1:].tolist(), strict=True):
            tracked.append(tracked[-1] + share * (balance - tracked[-1]))
        return np.array(tracked) + self.scale_n * offset[:, 0].numpy().astype(np.float64)

    def multiply_adds(self) -> int:
        return self.features.multiply_adds() + weights_in(self.network) + 2

    def _losses(
        self, sequences: Sequence[SequenceData], balances: Sequence[Single]
    ) -> Iterator[tuple[float, torch.Tensor]]:
        """Yield progress and mean absolute error of stretch after stretch of recordings side by side.

        The target of ``sequences`` is friction less force balance. State and tracked force carry on, the gradient does
        not.
        """
        generator = np.random.default_rng(self.build.seed)
        groups = math.ceil(len(sequences) / BATCH_SIZE)
        epochs = max(1, round(self.presentations / len(sequences)))
        for epoch, number in itertools.product(range(epochs), range(groups)):
            if number == 0:
                order = generator.permutation(len(sequences))
            group = order[number * BATCH_SIZE : (number + 1) * BATCH_SIZE]
            batch = side_by_side([sequences[one] for one in group])
            batch.weight[:BURN_IN] = 0.0
            balance = nn.utils.rnn.pad_sequence([torch.from_numpy(balances[one]) for one in group])
            cut = int(generator.integers(STRETCH))
            edges = sorted({0, *range(cut, len(balance), STRETCH), len(balance)})
            state, last = None, balance[0]
            for start, end in itertools.pairwise(edges):
                gain, offset, (hidden, cell) = self.network(batch.features[start:end], state)
                state = hidden.detach(), cell.detach()
                tracked = track(gain, balance[start:end], last)
                last = tracked[-1].detach()
                weight = batch.weight[start:end]
                if float(weight.sum()) > 0.0:
                    missed = tracked + offset - balance[start:end] - batch.target[start:end]
                    yield (epoch + number / groups) / epochs, (missed.abs() * weight).sum() / weight.sum()


def _mean_offset_n(cylinder: Cylinder, recordings: Sequence[Recording]) -> float:
    """Return the mean over recordings of |median of friction less force balance| [N], on usable rows."""
    areas = force_balance_taps(cylinder)[0, :, 0]
    known = [recording for recording in recordings if recording.usable().any()]
    offsets = [np.median((one.column("friction_n") - one.samples() @ areas)[one.usable()]) for one in known]
    return float(np.mean(np.abs(offsets)))


def track(gain: torch.Tensor, balance: torch.Tensor, last: torch.Tensor) -> torch.Tensor:
    """Return the tracked force, shape ``(time, batch)``, after ``last``, ``(batch,)``; differentiable by the gain.

    A parallel scan (Hillis and Steele 1986): after each pass a row holds the filter over twice as many steps.
    """
    kept, tracked = 1.0 - gain, gain * balance
    tracked = torch.cat([tracked[:1] + kept[:1] * last, tracked[1:]])
    span = 1
    while span < len(kept):
        tracked = torch.cat([tracked[:span], tracked[span:] + kept[span:] * tracked[:-span]])
        kept = torch.cat([kept[:span], kept[span:] * kept[:-span]])
        span *= 2
    return tracked


_TWIN = RegisteredModel(
    name="twin_hybrid",
    title="Hybrid trained on the twin",
    family="modern",
    source="after Revach et al. 2022 (KalmanNet); own training",
    build=LearnedGain,
    space={"nodes": (OneOf((32, 48)), 32), "learning_rate": (Float(2e-3, 1e-2, log=True), 5e-3)},
    supports=needs_raw_pressures,
    trained_on="twin",
    chosen="A filter of the force balance whose gain and offset an LSTM of one layer sets at every sample; where "
    "sensors are far off, it also sees the mean force balance of the strokes so far. Trained on true friction of "
    "random rigs, never on a recording of the rig that it is used on.",
)
MODELS = (
    _TWIN,
    replace(
        _TWIN,
        name="learned_gain",
        title="Learned gain, trained on labels",
        source="after Revach et al. 2022 (KalmanNet)",
        trained_on="recordings",
        chosen="The same filter and network as the hybrid trained on the twin, but trained on the rig's own labels.",
    ),
)
