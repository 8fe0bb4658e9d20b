"""A filter of the force balance whose gain a network sets at every step: it holds still where friction is steady, and
follows at once where friction breaks away.

    m[t] = m[t-1] + g[t] (b[t] - m[t-1]),   friction = m[t] + c[t],   b = P1·A1 - P2·A2

This is a Kalman filter of one state, a random walk, with its gain learnt instead of computed (Revach, Shlezinger, Ni,
Escoriza, van Sloun and Eldar 2022, "KalmanNet", IEEE Transactions on Signal Processing 70, where a recurrent network
gives the gain and the filter's structure stays). Chosen here: an LSTM gives the gain's logit and the offset c (what no
gain can give: a sensor's error, delay, a load); it sees no innovation of its own filter, but those of fixed ones, so
that it can be trained over whole sequences; both are held between its steps.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self

import numba
import numpy as np
import onnx

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.linear import force_balance_taps
from cylinder_friction.estimators.onnx_files import network_from_onnx, network_to_onnx
from cylinder_friction.realtime.activation import sigmoid
from cylinder_friction.realtime.lstm import Lstm, LstmState, head_of
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from friction_benchmark.models.tracking_features import TrackingFeatures, TrackingState

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from cylinder_friction.estimators.base import Array
    from cylinder_friction.recordings.recording import Recording
    from friction_benchmark.models.learned_gain_training import TrackingSequence

    Single = NDArray[np.float32]

NETWORK_FILE = "network.onnx"
LARGE_OFFSET_N = 30.0
"""Mean distance of a recording's friction from its force balance, above which strokes are worth remembering: zeroed
transmitters leave 10 N, transmitters as bought 200 N."""


@dataclass(frozen=True)
class GainArchitecture:
    """The LSTM of one layer, and what it sees.

    Attributes:
        nodes: Of the layer.
        strokes: Whether it sees the mean force balance of the strokes so far, which tells a sensor's offset; ``auto``:
            where offsets are large; small ones drown in how much friction's asymmetry differs from rig to rig.
    """

    nodes: int = 32
    strokes: Literal["seen", "hidden", "auto"] = "auto"


@dataclass(frozen=True)
class GainPlan:
    """How the network is trained.

    Attributes:
        lessons: Recordings gone through, each as often as there is time for; at least once.
        learning_rate: The highest.
        batch_size: Recordings side by side.
        stretch: Samples between two updates; a multiple of ``stride``.
        burn_in: First samples of each recording that are not scored.
        stride: Samples between two steps of the network.
        weight_decay: Of AdamW.
    """

    lessons: int
    learning_rate: float = 5e-3
    batch_size: int = 32
    stretch: int = 200
    burn_in: int = 100
    stride: int = 1
    weight_decay: float = 1e-3

    def __post_init__(self) -> None:
        if min(self.lessons, self.batch_size, self.stretch, self.stride) < 1 or self.stretch % self.stride:
            raise ValueError(
                "expected lessons, batch size, stretch and stride of at least 1, and a stretch that is a multiple of "
                f"the stride, but got {self}"
            )


@dataclass
class LearnedGainState:
    """State of features and network; the latest gain and offset; samples since the last step (0: a step is due); the
    tracked force [N], NaN before the first sample."""

    features: TrackingState
    network: LstmState
    gain: Array
    offset: Array
    phase: int
    tracked_n: Array


class LearnedGainEstimator(FrictionEstimator):
    """The force balance through a filter whose gain an LSTM sets. It trains to the end of its schedule.

    Args:
        cylinder: Its areas.
        architecture: Of the network.
        plan: Of its training, and its stride.
        inputs: Columns that it sees; both raw pressures and the position come first.
        seed: Of weights, and of the order of recordings.
    """

    kind: ClassVar[str] = "learned_gain"

    def __init__(
        self,
        cylinder: Cylinder,
        architecture: GainArchitecture,
        plan: GainPlan,
        inputs: Sequence[str] = SAMPLE_COLUMNS,
        seed: int = 0,
    ) -> None:
        super().__init__(inputs)
        self.cylinder, self.architecture, self.plan, self.seed = cylinder, architecture, plan, seed
        self.scale_n = 1.0
        self.features: TrackingFeatures | None = None
        self._network: Lstm | None = None
        self._offset_head: Single = np.zeros(architecture.nodes, dtype=np.float32)
        self._offset_bias = 0.0

    def fit(self, recordings: Sequence[Recording]) -> Self:
        """Learn from the recordings' ``friction_n``: labels, or a simulated rig's true friction.

        Raises:
            FloatingPointError: Training diverged.
            ValueError: The inputs do not begin with both pressures and the position.
        """
        from friction_benchmark.models.learned_gain_training import train_gain  # PyTorch: training alone waits

        self._begin_fit(recordings)
        strokes = self.architecture.strokes
        seen = strokes == "seen" or (strokes == "auto" and _mean_offset_n(self.cylinder, recordings) > LARGE_OFFSET_N)
        self.features = TrackingFeatures.of(self.cylinder, recordings, self.inputs, strokes=seen)
        pairs = [self.features.advance(self.features.new_state(), one.samples(self.inputs)) for one in recordings]
        left = [
            (one.column("friction_n") - balance_n)[one.usable()]
            for one, (_, balance_n) in zip(recordings, pairs, strict=True)
        ]
        self.scale_n = float(np.concatenate(left).std()) or 1.0
        lessons = [self._lesson(one, *pair) for one, pair in zip(recordings, pairs, strict=True)]
        weights, self._offset_head, self._offset_bias = train_gain(self.architecture, self.plan, lessons, self.seed)
        self._network = Lstm(weights)
        return self

    def new_state(self) -> LearnedGainState:
        assert self.features is not None
        assert self._network is not None
        return LearnedGainState(
            self.features.new_state(),
            self._network.new_state(),
            np.zeros(1),
            np.zeros(1),
            0,
            np.full(1, np.nan),
        )

    def advance(self, state: LearnedGainState, samples: Array) -> Array:
        assert self.features is not None
        assert self._network is not None
        features, balance_n = self.features.advance(state.features, samples)
        stride, phase, rows = self.plan.stride, state.phase, len(features)
        due = np.ascontiguousarray(features[-phase % stride :: stride])
        hidden, logit = self._network.advance(state.network, due)
        gain, offset = _heads(hidden, logit, self._offset_head, self._offset_bias)
        gain, offset = np.concatenate([state.gain, gain]), np.concatenate([state.offset, offset])
        latest = (phase + np.arange(rows)) // stride - (phase - 1) // stride
        state.gain, state.offset, state.phase = gain[-1:], offset[-1:], (phase + rows) % stride
        return np.asarray(_track(balance_n, gain[latest], state.tracked_n) + self.scale_n * offset[latest])

    def multiply_adds(self) -> int:
        """Return the multiply-adds of a sample at which the network steps: the most that a sample costs."""
        assert self.features is not None
        assert self._network is not None
        return self.features.multiply_adds() + self._network.weights.multiply_adds() + self.architecture.nodes + 2

    def _lesson(self, recording: Recording, features: Single, balance_n: Array) -> TrackingSequence:
        from friction_benchmark.models.learned_gain_training import TrackingSequence

        return TrackingSequence(
            features,
            (balance_n / self.scale_n).astype(np.float32),
            (recording.column("friction_n") / self.scale_n).astype(np.float32),
            recording.usable(),
        )

    def _write(self, folder: Path) -> dict[str, Any]:
        assert self.features is not None
        assert self._network is not None
        model = network_to_onnx(self._network.weights)
        (folder / NETWORK_FILE).write_bytes(model.SerializeToString(deterministic=True))
        return {
            "cylinder": asdict(self.cylinder),
            "architecture": asdict(self.architecture),
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
            GainArchitecture(**parameters["architecture"]),
            GainPlan(**parameters["plan"]),
            features.plan.inputs,
            parameters["seed"],
        )
        estimator.features, estimator.scale_n = features, parameters["scale_n"]
        estimator._network = Lstm(network_from_onnx(onnx.load(folder / NETWORK_FILE)))
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
