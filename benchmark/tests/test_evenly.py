"""A few items of many, spread evenly."""

from __future__ import annotations

import pytest

from friction_benchmark.evenly import evenly


@pytest.mark.parametrize(
    ("items", "count", "expected"),
    [
        (0, 3, []),
        (5, 8, [0, 1, 2, 3, 4]),
        (8, 8, [0, 1, 2, 3, 4, 5, 6, 7]),
        (9, 8, [0, 1, 2, 3, 4, 5, 6, 7]),
        (12, 8, [0, 1, 3, 4, 6, 7, 9, 10]),
        (96, 4, [0, 24, 48, 72]),
    ],
)
def test_it_takes_at_most_so_many_evenly_and_none_twice(items: int, count: int, expected: list[int]) -> None:
    assert evenly(range(items), count) == expected
