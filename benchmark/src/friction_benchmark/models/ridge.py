"""Ridge regression on lagged samples; effort cuts nothing."""

from cylinder_friction.estimators.linear import RidgeEstimator
from friction_benchmark.registry import BuildConfiguration, Range, RegisteredModel


def _build(build: BuildConfiguration) -> RidgeEstimator:
    return RidgeEstimator(build.whole("lags"), build.number("penalty"), build.inputs)


MODELS = (
    RegisteredModel(
        name="ridge",
        title="Ridge regression on lagged samples",
        family="modern",
        source="Hoerl and Kennard 1970",
        build=_build,
        space={"lags": Range(5, 60, integer=True), "penalty": Range(1e-3, 1e3, logarithmic=True)},
        defaults={"lags": 20, "penalty": 1.0},
        chosen="Raw samples, no features: linear in everything.",
    ),
)
