"""The published hybrid.

Ten times as costly as others, it has its epochs cut by effort to the power 1.7: of its 40, 4 serve it as well as 10.
"""

from cylinder_friction.estimators.forest import ForestPlan
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.training_plan import TrainingPlan
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from friction_benchmark.models.sequence_network import architecture
from friction_benchmark.registry import BuildConfiguration, OneOf, Range, RegisteredModel


def _build(build: BuildConfiguration) -> HybridEstimator:
    epochs = max(1, round(build.effort**1.7 * 40))
    return HybridEstimator(
        build.cylinder,
        "paper",
        architecture(build),
        TrainingPlan(epochs, 8, 200, 100, 16, "constant"),
        ForestPlan(build.whole("trees"), build.whole("depth"), build.share(10_000, 1000), 5),
        build.seed,
    )


def _has_the_papers_inputs(inputs: tuple[str, ...]) -> bool:
    return inputs == SAMPLE_COLUMNS


MODELS = (
    RegisteredModel(
        name="paper_hybrid",
        title="Published hybrid: LSTM 4×64 and forest",
        family="related work",
        source="the paper",
        build=_build,
        space={
            "layers": OneOf((3, 4, 5)),
            "nodes": OneOf((16, 32, 64)),
            "learning_rate": Range(1e-5, 1e-3, logarithmic=True),
            "dropout": OneOf((0.1, 0.2, 0.3, 0.4, 0.5)),
            "trees": Range(32, 100, integer=True),
            "depth": Range(10, 50, integer=True),
        },
        defaults={"layers": 4, "nodes": 64, "learning_rate": 1e-3, "dropout": 0.3, "trees": 64, "depth": 10},
        supports=_has_the_papers_inputs,
        chosen="Whole sequences with carried state, a linear head for training, the last hidden state into the forest. "
        "A small effort leaves so large a network an epoch or two; the pipeline's own report has it fully trained.",
    ),
)
