"""Polynomial NARX; effort cuts the rows."""

from __future__ import annotations

from typing import TYPE_CHECKING

from friction_benchmark.models.narx import NarxEstimator
from friction_benchmark.registry.model import Range, RegisteredModel

if TYPE_CHECKING:
    from friction_benchmark.registry.model import BuildConfiguration


def _build(build: BuildConfiguration) -> NarxEstimator:
    rows = build.share(120_000, 2000)
    return NarxEstimator(build.cylinder, build.inputs, build.whole("terms"), rows)


MODELS = (
    RegisteredModel(
        name="narx",
        title="NARX, polynomial, free running",
        family="modern",
        source="Ljung 1999; Billings 2013",
        build=_build,
        space={"terms": Range(20, 120, integer=True)},
        defaults={"terms": 60},
        chosen="Second degree; terms by orthogonal forward regression; its last estimate is fed back with a weight in "
        "[0, 0.98] that depends on speed, so that it is stable whatever comes in; fitted in free run.",
    ),
)
