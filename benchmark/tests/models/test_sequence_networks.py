"""The run-time GRU and TCN against PyTorch and ONNX Runtime; a slower step; training of whole sequences."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import onnxruntime
import pytest
import torch

from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.estimators.training import train_network
from cylinder_friction.estimators.training_plan import Architecture, SequenceData, TrainingPlan
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from friction_benchmark.models.gru import Gru, GruEstimator, gru_from_onnx, gru_to_onnx, gru_weights_of
from friction_benchmark.models.sequence_estimator import HeldMemory, SequenceEstimator
from friction_benchmark.models.sequence_networks import GruNetwork, TcnNetwork
from friction_benchmark.models.tcn import Tcn, TcnArchitecture, TcnEstimator, tcn_from_onnx, tcn_to_onnx, tcn_weights_of

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.recordings.recording import Recording

PLAN = TrainingPlan(epochs=2, patience=None, sequence_length=40, burn_in=0, batch_size=4)
STRIDE = 3
FEATURES, ROWS = 9, 300
SHAPES: dict[str, Architecture | TcnArchitecture] = {
    "gru, one layer": Architecture(1, 8, 0.0, 1e-3),
    "gru, two layers": Architecture(2, 16, 0.1, 1e-3),
    "tcn, narrow": TcnArchitecture(3, 4, 3, 0.1, 1e-3),
    "tcn, wide": TcnArchitecture(2, 12, 4, 0.0, 1e-3),
}


def random_network(architecture: Architecture | TcnArchitecture) -> tuple[Any, Any, Any]:
    """Return a network in PyTorch with random weights, the same as ONNX, and that at run time."""
    torch.manual_seed(3)
    network: Any
    if isinstance(architecture, TcnArchitecture):
        size = architecture
        network = TcnNetwork(FEATURES, size.levels, size.channels, size.kernel, size.dropout).eval()
    else:
        network = GruNetwork(architecture, FEATURES).eval()
    for parameter in network.parameters():
        torch.nn.init.normal_(parameter, std=0.4)
    if isinstance(network, TcnNetwork):
        model = tcn_to_onnx(tcn_weights_of(network))
        return network, model, Tcn(tcn_from_onnx(model))
    model = gru_to_onnx(gru_weights_of(network))
    return network, model, Gru(gru_from_onnx(model))


def some_features(rows: int = ROWS) -> np.ndarray:
    return np.random.default_rng(0).normal(size=(rows, FEATURES)).astype(np.float32)


@pytest.mark.parametrize("shape", sorted(SHAPES))
def test_the_step_equals_pytorch_and_onnx_runtime(shape: str) -> None:
    architecture = SHAPES[shape]
    network, model, run = random_network(architecture)
    features = some_features()
    head = run.advance(run.new_state(), features)
    assert head.shape == (ROWS,)
    with torch.no_grad():
        expected = network(torch.from_numpy(features)[:, None])[0][:, 0].numpy()
    scale = max(1.0, float(np.abs(expected).max()))
    np.testing.assert_allclose(head, expected, atol=1e-5 * scale)
    session = onnxruntime.InferenceSession(model.SerializeToString())
    if isinstance(architecture, TcnArchitecture):
        there = session.run(["head"], {"features": features.T[None]})[0][0, 0]
    else:
        zero = np.zeros((architecture.layers, 1, architecture.nodes), dtype=np.float32)
        there = session.run(["head"], {"features": features[:, None], "hidden_in": zero})[0][:, 0, 0]
    np.testing.assert_allclose(there, expected, atol=1e-5 * scale)


@pytest.mark.parametrize("shape", sorted(SHAPES))
def test_the_state_that_training_carries_makes_pieces_equal_the_whole(shape: str) -> None:
    network, _, _ = random_network(SHAPES[shape])
    features = torch.from_numpy(some_features())[:, None]
    with torch.no_grad():
        whole, _ = network(features)
        first, state = network(features[:7])
        second, _ = network(features[7:], state)
    np.testing.assert_allclose(torch.cat([first, second]).numpy(), whole.numpy(), atol=2e-5 * float(whole.abs().max()))


def test_the_receptive_field_is_what_an_output_depends_on() -> None:
    architecture = TcnArchitecture(3, 4, 3, 0.0, 1e-3)
    _, _, run = random_network(architecture)
    features = some_features()
    changed = features.copy()
    changed[100] += 5.0
    one, other = (run.advance(run.new_state(), each) for each in (features, changed))
    differs = np.flatnonzero(one != other)
    assert differs[0] == 100
    assert differs[-1] <= 99 + architecture.receptive_field() == 99 + 29


@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        ("gru, one layer", 3 * 8 * (9 + 8 + 1) + 8),
        ("gru, two layers", 3 * 16 * (9 + 16 + 1) + 3 * 16 * (16 + 16 + 1) + 16),
        ("tcn, narrow", 3 * 9 * 4 + 5 * 3 * 4 * 4 + 9 * 4 + 4),  # first and other convolutions, shortcut, head
    ],
)
def test_multiply_adds(shape: str, expected: int) -> None:
    _, _, run = random_network(SHAPES[shape])
    assert run.multiply_adds() == expected


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: GruEstimator(None, None, PLAN, stride=0), "expected a stride of at least 1 sample, but got 0"),  # type: ignore[arg-type]
        (lambda: TcnArchitecture(2, 4, 1, 0.0, 1e-3), "kernel >= 2"),
        (lambda: TcnArchitecture(2, 4, 2, 1.0, 1e-3), r"dropout in \[0, 1\)"),
    ],
)
def test_nonsense_is_refused(make: Callable[[], object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()


def delayed_sequences(count: int, seed: int, delay: int = 6) -> list[SequenceData]:
    """The target is the feature of some samples before: nothing without memory can tell it."""
    generator = np.random.default_rng(seed)
    result = []
    for _ in range(count):
        feature = np.repeat(generator.normal(size=120), 5).astype(np.float32)
        target = np.concatenate([np.zeros(delay, dtype=np.float32), feature[:-delay]])
        result.append(SequenceData(feature[:, None], target, np.ones(600, dtype=bool)))
    return result


def gru_of(inputs: int) -> torch.nn.Module:
    return GruNetwork(Architecture(1, 16, 0.0, 1e-2), inputs)


def tcn_of(inputs: int) -> torch.nn.Module:
    return TcnNetwork(inputs, levels=2, channels=12, kernel=3, dropout=0.0)


@pytest.mark.parametrize("make", [gru_of, tcn_of])
@pytest.mark.parametrize("stride", [1, 2])
def test_it_learns_what_needs_memory(make: Callable[[int], torch.nn.Module], stride: int) -> None:
    plan = TrainingPlan(15, 15, 30, 0, 4, warm_up=0.05, weight_decay=1e-3)
    train, validation = delayed_sequences(8, 0), delayed_sequences(2, 1)
    _, curve = train_network(make, 1e-2, plan, train, validation, seed=3, stride=stride)
    assert min(curve.validation_mae) < 0.5 * curve.validation_mae[0]
    assert curve.validation_mae[curve.best_epoch - 1] == min(curve.validation_mae)


MAKERS: dict[str, Callable[[Cylinder, tuple[str, ...], int], SequenceEstimator]] = {
    "gru": lambda *made: GruEstimator(made[0], Architecture(1, 8, 0.1, 1e-2), PLAN, *made[1:], STRIDE),
    "tcn": lambda *made: TcnEstimator(made[0], TcnArchitecture(2, 6, 3, 0.1, 1e-2), PLAN, *made[1:], STRIDE),
}


@pytest.fixture(scope="module", params=[(name, free) for name in sorted(MAKERS) for free in (False, True)], ids=str)
def fitted(
    request: pytest.FixtureRequest, cylinder: Cylinder, labelled_recordings: list[Recording]
) -> SequenceEstimator:
    name, free = request.param
    estimator = MAKERS[name](cylinder, ("position_m",) if free else SAMPLE_COLUMNS, 0)
    estimator.fit(labelled_recordings[:4])
    return estimator


def test_cutting_the_input_changes_nothing(fitted: SequenceEstimator, labelled_recordings: list[Recording]) -> None:
    recording = labelled_recordings[0]
    samples = recording.samples(fitted.inputs)[:100]
    whole = fitted.advance(fitted.new_state(), samples)
    for cuts in ([1, 2, 3], [50], [4, 4, 99], list(range(1, 100))):
        state = fitted.new_state()
        pieces = [fitted.advance(state, piece) for piece in np.split(samples, cuts)]
        np.testing.assert_array_equal(np.concatenate(pieces), whole)
    np.testing.assert_array_equal(fitted.estimate(recording)[:100], whole)


def test_save_and_load_round_trip(
    fitted: SequenceEstimator, labelled_recordings: list[Recording], tmp_path: Path
) -> None:
    fitted.save(tmp_path / "model")
    loaded = load_estimator(tmp_path / "model")
    assert isinstance(loaded, type(fitted))
    assert (loaded.plan, loaded.architecture, loaded.inputs) == (fitted.plan, fitted.architecture, fitted.inputs)
    np.testing.assert_array_equal(loaded.estimate(labelled_recordings[0]), fitted.estimate(labelled_recordings[0]))
    assert loaded.multiply_adds() == fitted.multiply_adds()
    assert {path.suffix for path in (tmp_path / "model").iterdir()} <= {".json", ".onnx"}


@pytest.mark.parametrize("name", sorted(MAKERS))
def test_the_same_seed_gives_the_same_bits(
    name: str, cylinder: Cylinder, labelled_recordings: list[Recording], tmp_path: Path
) -> None:
    for seed, folder in ((7, "one"), (7, "two"), (8, "three")):
        estimator = MAKERS[name](cylinder, SAMPLE_COLUMNS, seed)
        estimator.fit(labelled_recordings[:3])
        estimator.save(tmp_path / folder)
    one, two, three = ((tmp_path / folder / "network.onnx").read_bytes() for folder in ("one", "two", "three"))
    assert one == two != three


def test_between_two_steps_the_correction_is_held(cylinder: Cylinder, labelled_recordings: list[Recording]) -> None:
    estimator = MAKERS["gru"](cylinder, SAMPLE_COLUMNS, 0)
    estimator.fit(labelled_recordings[:3])
    features = some_features(60)[:, :1] * np.ones((1, len(estimator.features.names)), dtype=np.float32)  # type: ignore[union-attr]
    output = estimator.predict(estimator.new_memory(), features)
    np.testing.assert_array_equal(output, np.repeat(output[::3], 3))
    assert len(np.unique(output)) == 20
    memory = estimator.new_memory()
    assert isinstance(memory, HeldMemory)
    estimator.predict(memory, features[:4])
    assert memory.phase == 1
