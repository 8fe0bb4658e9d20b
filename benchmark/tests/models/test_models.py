"""Every model of the registry on several sets of sensors: it learns, looks at nothing else, and never looks ahead."""

from __future__ import annotations

import pickle
from typing import TYPE_CHECKING

import numpy as np
import pytest

from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording
from friction_benchmark.registry import BuildConfiguration, Float, Int, OneOf, registered_models

if TYPE_CHECKING:
    from cylinder_friction.cylinder import Cylinder
    from friction_benchmark.registry import Estimator, RegisteredModel, Value

EFFORT, ROWS, CUT = 0.005, 800, 500
SENSORS = {
    "raw": SAMPLE_COLUMNS,
    "raw_and_temperature": (*SAMPLE_COLUMNS, "oil_temperature_c"),
    "levels": ("position_m", "oil_temperature_c", "pressure_1_level_pa", "pressure_2_level_pa"),
}
MODELS = registered_models()
CASES = [
    (name, sensors)
    for name, model in MODELS.items()
    for sensors, inputs in SENSORS.items()
    if model.supports(inputs) and not (sensors == "raw" and model.supports(SENSORS["raw_and_temperature"]))
]
DRAWN = ("machado", "pan_elman", "elman_adam", "han_zero_shot", "gru", "tcn", "learned_gain")
"""Models whose first weights are drawn."""
LARGEST_ERROR = {
    "machado": 0.3, "elman_adam": 0.3, "han_fine_tuned": 0.35, "narx": 0.6, "gradient_boosting": 0.6,
    "lugre_residual": 0.6, "constant_by_direction": 0.6, "coulomb_viscous_line": 0.6,
}  # fmt: skip
"""On the position alone, as a share of mean friction, trained at one load and with little effort."""


@pytest.fixture(scope="module")
def recordings(labelled_recordings: list[Recording]) -> list[Recording]:
    """The first seconds of each, with an oil temperature and pressures that vary slowly."""
    made = []
    for number, whole in enumerate(labelled_recordings):
        recording = Recording(whole.metadata, whole.table.iloc[:ROWS].reset_index(drop=True))
        levels = {
            f"pressure_{side}_level_pa": np.full(ROWS, recording.column(f"pressure_{side}_pa").mean())
            for side in (1, 2)
        }
        made.append(recording.with_columns(oil_temperature_c=np.linspace(30.0, 35.0, ROWS) + number, **levels))
    return made


def built(
    model: RegisteredModel, inputs: tuple[str, ...], cylinder: Cylinder, effort: float = EFFORT, seed: int = 0
) -> Estimator:
    return model.build(BuildConfiguration(cylinder, inputs, seed, effort, model.defaults))


@pytest.fixture(scope="module", params=CASES, ids="-".join)
def fitted(request: pytest.FixtureRequest, cylinder: Cylinder, recordings: list[Recording]) -> Estimator:
    name, sensors = request.param
    estimator = built(MODELS[name], SENSORS[sensors], cylinder)
    estimator.fit(recordings)
    return estimator


def test_it_estimates_friction_of_the_right_size(fitted: Estimator, recordings: list[Recording]) -> None:
    estimate, friction = fitted.estimate(recordings[0]), recordings[0].column("friction_n")
    assert estimate.shape == friction.shape
    assert np.abs(estimate - friction).mean() < 1.1 * np.abs(friction).mean()
    assert fitted.multiply_adds() > 0


def test_the_future_never_changes_the_past(fitted: Estimator, recordings: list[Recording]) -> None:
    recording = recordings[0]
    later = np.arange(ROWS) >= CUT
    changed = recording.with_columns(
        **{
            name: np.where(later, 1.3 * values, values)
            for name in fitted.inputs
            if (values := recording.column(name)).any()
        }
    )
    before, after = fitted.estimate(recording), fitted.estimate(changed)
    np.testing.assert_allclose(after[:CUT], before[:CUT], rtol=1e-6, atol=1e-3)
    assert not np.allclose(after[CUT:], before[CUT:])


def test_it_looks_at_its_inputs_alone(fitted: Estimator, recordings: list[Recording]) -> None:
    recording = recordings[0]
    seen = {"time_s", "usable", *fitted.inputs}
    hidden = [name for name in recording.columns if name not in seen]
    changed = recording.with_columns(**{name: recording.column(name)[::-1] + 1e5 for name in hidden})
    np.testing.assert_array_equal(fitted.estimate(changed), fitted.estimate(recording))


@pytest.mark.parametrize("name", DRAWN)
def test_a_seed_decides_all_that_is_drawn(name: str, cylinder: Cylinder, recordings: list[Recording]) -> None:
    estimates = []
    for seed in (3, 3, 4):
        estimator = built(MODELS[name], SAMPLE_COLUMNS, cylinder, 0.003, seed)
        estimator.fit(recordings[:2])
        estimates.append(estimator.estimate(recordings[0]))
    np.testing.assert_array_equal(estimates[0], estimates[1])
    assert not np.array_equal(estimates[0], estimates[2])


@pytest.mark.parametrize("name", sorted(LARGEST_ERROR))
def test_motion_explains_most_of_friction_at_one_load(
    name: str, cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    one_load = labelled_recordings[:2]
    estimator = built(MODELS[name], ("position_m",), cylinder, 0.02)
    estimator.fit(one_load)
    errors = [np.abs(estimator.estimate(one) - one.column("friction_n")).mean() for one in one_load]
    assert np.mean(errors) < LARGEST_ERROR[name] * np.mean(
        [np.abs(one.column("friction_n")).mean() for one in one_load]
    )


@pytest.mark.parametrize(
    ("inputs", "unable"),
    [
        (SAMPLE_COLUMNS, set()),
        (("pressure_1_pa", "pressure_2_pa"), set(MODELS)),
        (
            ("position_m", "oil_temperature_c"),
            {
                "low_pass",
                "hold",
                "pressure_lugre",
                "disturbance_observer",
                "paper_hybrid",
                "twin_hybrid",
                "learned_gain",
            },
        ),
        (
            SENSORS["levels"],
            {"low_pass", "hold", "disturbance_observer", "paper_hybrid", "twin_hybrid", "learned_gain"},
        ),
    ],
)
def test_a_model_takes_part_if_it_has_its_inputs(inputs: tuple[str, ...], unable: set[str]) -> None:
    assert {name for name, model in MODELS.items() if not model.supports(inputs)} == unable


@pytest.mark.parametrize("end", [0, -1])
@pytest.mark.parametrize("name", [name for name, model in MODELS.items() if model.space])
def test_both_ends_of_what_may_be_tuned_can_be_built(name: str, end: int, cylinder: Cylinder) -> None:
    def corner(where: Int | Float | OneOf) -> Value:
        return where.choices[end] if isinstance(where, OneOf) else (where.low, where.high)[end]

    chosen = {key: corner(where) for key, (where, _) in MODELS[name].space.items()}
    MODELS[name].build(BuildConfiguration(cylinder, SAMPLE_COLUMNS, 0, EFFORT, chosen))


def test_the_registry_names_what_workers_find_again() -> None:
    assert len(MODELS) == 27
    for model in MODELS.values():
        assert pickle.loads(pickle.dumps(model)).name == model.name
        assert model.module.startswith("friction_benchmark.models.")
        assert model.source
    with pytest.raises(ValueError, match=r"two models are called 'gru'; the second is in friction"):
        registered_models(["friction_benchmark.models.gru"] * 2)


@pytest.mark.parametrize("name", ["constant_by_direction", "disturbance_observer", "learned_gain"])
def test_missing_inputs_are_refused(name: str, cylinder: Cylinder, recordings: list[Recording]) -> None:
    with pytest.raises(ValueError, match="inputs"):
        built(MODELS[name], ("oil_temperature_c",), cylinder).fit(recordings)
