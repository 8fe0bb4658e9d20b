from __future__ import annotations

import numpy as np
import pytest

from cylinder_friction.labelling.events import event_masks


def velocity(*stretches: tuple[float, int]) -> np.ndarray:
    return np.concatenate([np.full(rows, value) for value, rows in stretches])


@pytest.mark.parametrize(
    ("motion", "expected"),
    [
        (velocity((0.0, 50), (0.1, 50)), {"start": [50]}),
        (velocity((0.1, 50), (0.0, 50)), {"stop": [50]}),
        (velocity((0.1, 50), (-0.1, 50)), {"reversal": [50]}),
        (velocity((0.1, 40), (0.0, 5), (-0.1, 40)), {"reversal": [40, 45]}),
        (velocity((0.1, 40), (0.0, 30), (-0.1, 40)), {"stop": [40], "start": [70]}),
        (velocity((0.1, 40), (0.0, 5), (0.1, 40)), {"stop": [40], "start": [45]}),
        (velocity((0.1, 100)), {}),
        (velocity((5e-4, 50), (-5e-4, 50)), {}),
    ],
)
def test_each_kind_of_event(motion: np.ndarray, expected: dict[str, list[int]]) -> None:
    masks = event_masks(motion, 10)
    for kind, mask in masks.items():
        wanted = np.zeros(len(motion), dtype=bool)
        for row in expected.get(kind, []):
            wanted[max(row - 10, 0) : row + 11] = True
        np.testing.assert_array_equal(mask, wanted)
