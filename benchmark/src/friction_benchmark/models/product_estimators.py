"""The product's estimators: its hybrid of LSTM and random forest, its LSTM alone, the published hybrid, and ridge.

Ten times as costly as others, the published hybrid has its epochs cut by effort to the power 1.7: of its 40, 4 serve it
as well as 10. Effort cuts nothing of ridge.
"""

from functools import partial

from cylinder_friction.estimators.forest import ForestPlan
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.linear import RidgeEstimator
from cylinder_friction.estimators.training_plan import TrainingPlan
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from friction_benchmark.models.sequence_network import PRESSURE_FREE_EPOCHS, SPACE, architecture, training_plan
from friction_benchmark.registry import BuildConfiguration, Float, Int, OneOf, RegisteredModel


def _forest(build: BuildConfiguration, rows: int, leaf: int) -> ForestPlan:
    return ForestPlan(build.whole("trees"), build.whole("depth"), build.share(rows, 1000), leaf)


def _hybrid(forest: bool, build: BuildConfiguration) -> HybridEstimator:
    epochs = 40 if forest else 60
    return HybridEstimator(
        build.cylinder,
        architecture=architecture(build),
        plan=training_plan(build, epochs, steps=200, slower=PRESSURE_FREE_EPOCHS),
        forest_plan=_forest(build, 15_000, 10) if forest else None,
        seed=build.seed,
        inputs=build.inputs,
    )


def _published(build: BuildConfiguration) -> HybridEstimator:
    plan = TrainingPlan(max(1, round(build.effort**1.7 * 40)), 8, 200, 100, 16, "constant")
    return HybridEstimator(build.cylinder, "paper", architecture(build), plan, _forest(build, 10_000, 5), build.seed)


def _ridge(build: BuildConfiguration) -> RidgeEstimator:
    return RidgeEstimator(build.whole("lags"), build.number("penalty"), build.inputs)


def _has_the_papers_inputs(inputs: tuple[str, ...]) -> bool:
    return inputs == SAMPLE_COLUMNS


MODELS = (
    RegisteredModel(
        name="hybrid",
        title="Hybrid: LSTM and forest",
        family="modern",
        source="after the paper; Hochreiter and Schmidhuber 1997, Breiman 2001",
        build=partial(_hybrid, True),
        space={**SPACE, "trees": (Int(16, 32), 24), "depth": (Int(6, 12), 10)},
        learns_offset=True,
        chosen="The LSTM corrects the force balance where there is one; the forest learns the LSTM's residual, from "
        "its state, its output and the features; leaves of 20 rows or more; mean absolute error, AdamW, cosine. Where "
        "sensors drift it learns their offset in each recording, as the product does.",
    ),
    RegisteredModel(
        name="lstm",
        title="LSTM",
        family="modern",
        source="Hochreiter and Schmidhuber 1997",
        build=partial(_hybrid, False),
        space=SPACE,
        learns_offset=True,
        chosen="The hybrid without its forest, with the forest's time spent on epochs.",
    ),
    RegisteredModel(
        name="paper_hybrid",
        title="Published hybrid: LSTM 4×64 and forest",
        family="related work",
        source="the paper",
        build=_published,
        space={
            "layers": (OneOf((3, 4, 5)), 4),
            "nodes": (OneOf((16, 32, 64)), 64),
            "learning_rate": (Float(1e-5, 1e-3, log=True), 1e-3),
            "dropout": (OneOf((0.1, 0.2, 0.3, 0.4, 0.5)), 0.3),
            "trees": (Int(32, 100), 64),
            "depth": (Int(10, 50), 10),
        },
        supports=_has_the_papers_inputs,
        chosen="Whole sequences with carried state, a linear head for training, the last hidden state into the forest. "
        "A small effort leaves so large a network an epoch or two; the pipeline's own report has it fully trained.",
    ),
    RegisteredModel(
        name="ridge",
        title="Ridge regression on lagged samples",
        family="modern",
        source="Hoerl and Kennard 1970",
        build=_ridge,
        space={"lags": (Int(5, 60), 20), "penalty": (Float(1e-3, 1e3, log=True), 1.0)},
        chosen="Raw samples, no features: linear in everything.",
    ),
)
