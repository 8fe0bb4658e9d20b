"""A progress bar for whoever watches a terminal."""

import sys
from collections.abc import Iterable
from typing import Any, TypeVar

from tqdm import tqdm

Item = TypeVar("Item")


def shown(items: Iterable[Item], words: str, total: int, unit: str, **look: Any) -> Iterable[Item]:
    """Return the items, with a bar on standard error if that is a terminal; further options are those of tqdm."""
    if not (sys.stderr and sys.stderr.isatty()):
        return items
    return tqdm(items, words, total, unit=unit, **look)
