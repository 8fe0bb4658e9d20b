"""The related work's networks as estimators: causal, cut anywhere, stored and read back, and what each of them sees."""

from __future__ import annotations

import subprocess
import sys
from typing import TYPE_CHECKING

import numpy as np
import pytest

from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording
from friction_benchmark.models.elman import ElmanPlan
from friction_benchmark.models.han import HanEstimator, HanPlan
from friction_benchmark.models.machado import MachadoEstimator, MachadoPlan
from friction_benchmark.registry import elman, han, machado
from friction_benchmark.registry.model import BuildConfiguration

if TYPE_CHECKING:
    from pathlib import Path

    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.estimators.base import FrictionEstimator
    from cylinder_friction.recordings.recording import Recording

PRESSURE_FREE = ("position_m",)
WITH_TEMPERATURE = ("position_m", "oil_temperature_c")
MODELS = (*machado.MODELS, *elman.MODELS, *han.MODELS)
NAMES = [entry.name for entry in MODELS]


@pytest.fixture(scope="module")
def warm_recordings(labelled_recordings: list[Recording]) -> list[Recording]:
    return [
        recording.with_columns(oil_temperature_c=np.linspace(30.0 + number, 35.0 + number, len(recording)))
        for number, recording in enumerate(labelled_recordings)
    ]


def made(
    name: str, cylinder: Cylinder, inputs: tuple[str, ...], seed: int = 0, effort: float = 0.02
) -> FrictionEstimator:
    entry = next(entry for entry in MODELS if entry.name == name)
    return entry.build(BuildConfiguration(cylinder, inputs, seed, effort, entry.defaults))


def error_n(estimator: FrictionEstimator, recordings: list[Recording]) -> float:
    errors = [np.abs(estimator.estimate(r) - r.column("friction_n"))[r.usable()] for r in recordings]
    return float(np.mean(np.concatenate(errors)))


@pytest.fixture(
    scope="module",
    params=[(name, inputs) for name in NAMES for inputs in (SAMPLE_COLUMNS, WITH_TEMPERATURE)],
    ids=lambda p: f"{p[0]}-{len(p[1])}",
)
def fitted(request: pytest.FixtureRequest, cylinder: Cylinder, warm_recordings: list[Recording]) -> FrictionEstimator:
    name, inputs = request.param
    estimator = made(name, cylinder, inputs)
    estimator.fit(warm_recordings)
    return estimator


def test_cutting_into_pieces_changes_nothing(fitted: FrictionEstimator, warm_recordings: list[Recording]) -> None:
    samples = warm_recordings[0].samples(fitted.inputs)[:700]
    whole = fitted.advance(fitted.new_state(), samples)
    state = fitted.new_state()
    pieces = [fitted.advance(state, piece) for piece in np.split(samples, [1, 2, 7, 7, 100, 333])]
    np.testing.assert_array_equal(np.concatenate(pieces), whole)


def test_the_future_does_not_change_the_past(fitted: FrictionEstimator, warm_recordings: list[Recording]) -> None:
    samples = warm_recordings[0].samples(fitted.inputs)[:700]
    changed = samples.copy()
    changed[350:] *= 1.1
    before = fitted.advance(fitted.new_state(), samples)
    np.testing.assert_array_equal(fitted.advance(fitted.new_state(), changed)[:350], before[:350])


def test_save_and_load(fitted: FrictionEstimator, warm_recordings: list[Recording], tmp_path: Path) -> None:
    fitted.save(tmp_path)
    loaded = load_estimator(tmp_path)
    assert loaded.inputs == fitted.inputs
    assert loaded.multiply_adds() == fitted.multiply_adds() > 0
    np.testing.assert_array_equal(loaded.estimate(warm_recordings[1]), fitted.estimate(warm_recordings[1]))
    assert {path.suffix for path in tmp_path.iterdir()} <= {".json", ".onnx"}


@pytest.mark.parametrize("name", NAMES)
def test_the_seed_decides_all(name: str, cylinder: Cylinder, warm_recordings: list[Recording]) -> None:
    estimates = []
    for seed in (3, 3, 4):
        estimator = made(name, cylinder, PRESSURE_FREE, seed, 0.005)
        estimator.fit(warm_recordings)
        estimates.append(estimator.estimate(warm_recordings[0]))
    np.testing.assert_array_equal(estimates[0], estimates[1])
    assert not np.array_equal(estimates[0], estimates[2])


@pytest.mark.parametrize("name", NAMES)
def test_velocity_explains_most_of_friction_without_pressures(
    name: str, cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    one_load = [recording for recording in labelled_recordings if recording.metadata.condition == "1"]
    estimator = made(name, cylinder, PRESSURE_FREE, effort=0.05)
    estimator.fit(one_load)
    level = float(np.mean(np.abs(one_load[0].column("friction_n"))))
    assert error_n(estimator, one_load) < (0.4 if name == "han_zero_shot" else 0.25) * level


def test_machado_without_the_force_balance_knows_pressures_at_standstill_alone(
    cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    estimator = MachadoEstimator(cylinder, plan=MachadoPlan(iterations=40, corrects="nothing"))
    estimator.fit(labelled_recordings)
    recording = labelled_recordings[0]
    samples = recording.samples()
    louder = samples.copy()
    louder[:, 0] += 2e5
    difference = estimator.advance(estimator.new_state(), louder) - estimator.advance(estimator.new_state(), samples)
    fast = np.abs(recording.column("velocity_m_s")) > 0.02
    assert np.abs(difference[fast]).max() == 0.0
    assert np.abs(difference).max() > 0.0


def test_without_fine_tuning_no_label_is_learnt_from(cylinder: Cylinder, labelled_recordings: list[Recording]) -> None:
    plan = HanPlan(fine_tuned=False, synthetic_steps=5)
    other = [r.with_columns(friction_n=7.0 - 3.0 * r.column("friction_n")) for r in labelled_recordings]
    estimates = []
    for recordings in (labelled_recordings, other):
        estimator = HanEstimator(cylinder, plan=plan)
        estimator.fit(recordings)
        estimates.append(estimator.estimate(labelled_recordings[0]))
    np.testing.assert_array_equal(*estimates)


def test_without_fine_tuning_pressures_are_not_looked_at(
    cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    estimator = HanEstimator(cylinder, plan=HanPlan(fine_tuned=False, synthetic_steps=5))
    estimator.fit(labelled_recordings)
    samples = labelled_recordings[0].samples()
    without = samples * [0.0, 0.0, 1.0]
    np.testing.assert_array_equal(
        estimator.advance(estimator.new_state(), samples), estimator.advance(estimator.new_state(), without)
    )


def test_fine_tuning_gains_on_synthetic_friction_of_another_cylinder(
    cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    errors = []
    for fine_tuned in (False, True):
        estimator = HanEstimator(cylinder, PRESSURE_FREE, HanPlan(fine_tuned, synthetic_steps=60, tuning_steps=120))
        estimator.fit(labelled_recordings)
        errors.append(error_n(estimator, labelled_recordings))
    assert errors[1] < 0.8 * errors[0]


@pytest.mark.parametrize(
    ("plan", "bad", "words"),
    [
        (MachadoPlan, {"nodes": 0}, "expected nodes, delay and iterations of at least 1"),
        (ElmanPlan, {"feedback": 1.0}, "expected nodes and evaluations of at least 1 and feedback in"),
        (HanPlan, {"fine_tuned": True, "spread": 1.0}, "expected layers, nodes and steps of at least 1 and a spread"),
    ],
)
def test_impossible_plans_are_refused(plan: type, bad: dict[str, float], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        plan(**bad)


def test_importing_them_imports_no_torch() -> None:
    code = "import sys; from friction_benchmark.registry import elman, han, machado; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
