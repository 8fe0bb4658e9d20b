"""Titles and marks of the models: colour and shape both state the family, either alone suffices."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from cylinder_friction.reporting.style import BLACK, BLUE, ORANGE, PINK
from friction_benchmark.results import ModelInfo

Mark = tuple[str, str, str]  # Colour, a letter that looks like the shape, and Plotly's name of the shape

FAMILIES: dict[str, Mark] = {
    "baseline": (BLACK, "✚", "cross"),
    "analytical": (ORANGE, "■", "square"),
    "related work": (PINK, "▲", "triangle-up"),
    "modern": (BLUE, "●", "circle"),
}
"""In the order of legends."""


@dataclass(frozen=True)
class ModelTitles:
    """Titles and marks of the models, by their name in the registry."""

    models: Mapping[str, ModelInfo]

    def __call__(self, model: str) -> str:
        """Return a model's title; a baseline that was not run has its name in the registry alone."""
        return self.models[model].title if model in self.models else model

    def family(self, model: str) -> str:
        return self.models[model].family

    def legend(self, models: Iterable[str]) -> list[tuple[str, Mark]]:
        """Return every family among the models and its mark, baselines first."""
        present = {self.family(model) for model in models}
        return [(family, mark) for family, mark in FAMILIES.items() if family in present]

    def by_family(self, models: Iterable[str]) -> list[str]:
        """Return the models family by family, each family in the order given."""
        return sorted(models, key=lambda model: list(FAMILIES).index(self.family(model)))
