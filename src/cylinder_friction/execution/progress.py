"""Progress of long work: a bar on a terminal; elsewhere, as in a file or CI, one line a minute."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Iterable, Iterator
from datetime import timedelta
from typing import TYPE_CHECKING, Any, Self, TypeAlias

if TYPE_CHECKING:
    from tqdm import tqdm

FIRST_LINE_S = 2.0
"""Time from the import of this module to the first line [s]. Shorter work prints nothing."""
LINE_EVERY_S = 60.0
_LOOK_EVERY_S = 0.5

_began_s = time.monotonic()
_unfinished: list[Lines] = []

Progress: TypeAlias = "tqdm[Any] | Lines"


def progress(
    items: Iterable[Any] | None = None,
    words: str = "",
    total: int | None = None,
    *,
    unit: str,
    leave: bool = True,
) -> Progress:
    """Show on standard error how far work is, while you iterate over the result or ``update`` it in a ``with`` block.

    Without a terminal, a thread prints a line after two seconds and then every minute, even if a single item takes
    longer. The line names all unfinished work, the outermost first.

    Args:
        items: What is worked on, one by one; None if you call ``update``.
        words: Name of the work.
        total: Number of items; None: the length of ``items``.
        unit: Name of one item.
        leave: Whether a finished bar stays on the terminal.

    Example:
        >>> from cylinder_friction.execution.progress import progress
        >>> sum(progress([1, 2, 3], "add", unit="number"))
        6
    """
    if sys.stderr is None or not sys.stderr.isatty():
        return Lines(() if items is None else items, words, total, unit)
    from tqdm import tqdm  # slow to import, so only if a bar is shown

    return tqdm(items, words, total, unit=unit, leave=leave)


class Lines:
    """Work whose progress is printed in lines; it has the methods of ``tqdm`` that this package calls."""

    def __init__(self, items: Iterable[Any], words: str, total: int | None, unit: str) -> None:
        self.items, self.words, self.unit = items, words, unit
        self.total = len(list(items)) if total is None else total
        self.n = 0
        self.began_s = time.monotonic()

    def __enter__(self) -> Self:
        _unfinished.append(self)
        if not any(thread.name == __name__ for thread in threading.enumerate()):
            threading.Thread(target=_print_lines, name=__name__, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        _unfinished.remove(self)

    def __iter__(self) -> Iterator[Any]:
        with self:
            for item in self.items:
                yield item
                self.n += 1

    def update(self, count: float = 1) -> None:
        self.n += int(count)

    def set_postfix_str(self, words: str, refresh: bool = True) -> None:
        """Do nothing: lines are short."""

    def __str__(self) -> str:
        spent_s = time.monotonic() - self.began_s
        line = f"{self.words}: {self.n} of {self.total} {self.unit}s after {_clock(spent_s)}"
        return line if self.n == 0 else f"{line}, about {_clock(spent_s / self.n * (self.total - self.n))} left"


def _print_lines() -> None:
    """Print the unfinished work of this process."""
    next_s = _began_s + FIRST_LINE_S
    while True:
        time.sleep(_LOOK_EVERY_S)
        line = "; ".join(map(str, _unfinished))
        if line and time.monotonic() >= next_s:
            next_s = time.monotonic() + LINE_EVERY_S
            sys.stderr.write(f"{line}\n")
            sys.stderr.flush()


def _clock(seconds: float) -> timedelta:
    return timedelta(seconds=round(seconds))
