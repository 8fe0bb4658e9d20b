"""A few items of many, spread evenly."""

from collections.abc import Sequence
from typing import TypeVar

Item = TypeVar("Item")


def evenly(items: Sequence[Item], count: int) -> list[Item]:
    """Return at most ``count`` items, spread evenly in their order, none of them twice: all where there are fewer."""
    taken = min(count, len(items))
    return [items[number * len(items) // taken] for number in range(taken)]
