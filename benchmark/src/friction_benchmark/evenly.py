"""A few items of many, spread evenly."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from collections.abc import Sequence

Item = TypeVar("Item")


def evenly(items: Sequence[Item], count: int) -> list[Item]:
    """Return at most ``count`` items, spread evenly in their order, none of them twice: all where there are fewer."""
    taken = min(count, len(items))
    return [items[number * len(items) // taken] for number in range(taken)]
