"""What a participant is called and how it is marked: colour and shape tell its family, either alone suffices."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from cylinder_friction.reporting import estimator_titles as known

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from friction_benchmark.results import ModelInfo

FAMILIES: dict[str, tuple[str, str]] = {
    "baseline": ("#000000", "cross"),
    "analytical": ("#D55E00", "square"),
    "related work": ("#CC79A7", "triangle"),
    "modern": ("#0072B2", "circle"),
}
"""Colour, from the palette of Okabe and Ito (2008), and shape, by family in the order of legends."""

_OTHER = ("#6B7280", "diamond")


@dataclass(frozen=True)
class Names:
    """Titles and marks of the participants, by their name in the roster."""

    models: Mapping[str, ModelInfo]

    def title(self, model: str) -> str:
        """Return its title; a model that is no participant keeps the name the project knows it by."""
        return self.models[model].title if model in self.models else known.title(model)

    def family(self, model: str) -> str:
        return self.models[model].family if model in self.models else "other"

    def mark(self, model: str) -> tuple[str, str]:
        """Return colour and shape."""
        return FAMILIES.get(self.family(model), _OTHER)

    def legend(self, models: Iterable[str]) -> list[tuple[str, str, str]]:
        """Return family, colour and shape of every family among the models, floors first."""
        present = {self.family(model): self.mark(model) for model in models}
        order = [family for family in FAMILIES if family in present]
        order += sorted(family for family in present if family not in FAMILIES)
        return [(family, *present[family]) for family in order]

    def by_family(self, models: Iterable[str]) -> list[str]:
        """Return the models family by family, each family in the order given."""
        order = list(FAMILIES)
        return sorted(models, key=lambda model: order.index(f) if (f := self.family(model)) in order else len(order))
