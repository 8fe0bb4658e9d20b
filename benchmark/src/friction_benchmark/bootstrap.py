"""How sure a percentage is: the block bootstrap, which keeps the memory inside a block."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cylinder_friction.arrays import Array, Mask

INTERVAL = (0.025, 0.975)


@dataclass(frozen=True)
class BlockSums:
    """Sums over the usable rows of each block: absolute error and absolute friction [N], shape ``(blocks,)``."""

    abs_error_n: Array
    abs_friction_n: Array

    @property
    def percent(self) -> float:
        """MAE / mean |friction| over all blocks [%]."""
        return 100.0 * float(self.abs_error_n.sum() / self.abs_friction_n.sum())


def block_sums(
    references_n: Sequence[Array], estimates_n: Sequence[Array], usable: Sequence[Mask], rows_per_block: int
) -> BlockSums:
    """Return the sums of every block that holds a usable row; a block never spans two recordings."""
    errors: list[Array] = []
    frictions: list[Array] = []
    for reference, estimate, mask in zip(references_n, estimates_n, usable, strict=True):
        rows = np.flatnonzero(mask)
        if len(rows) == 0:
            continue
        starts = np.flatnonzero(np.diff(rows // rows_per_block, prepend=-1))
        errors.append(np.add.reduceat(np.abs(estimate[rows] - reference[rows]), starts))
        frictions.append(np.add.reduceat(np.abs(reference[rows]), starts))
    return BlockSums(np.concatenate(errors), np.concatenate(frictions))


def bootstrap_percent(sums: BlockSums, repeats: int, seed: int) -> Array:
    """Return ``repeats`` draws of MAE / mean |friction| [%], shape ``(repeats,)``.

    Every draw takes as many blocks as there are, with replacement. One seed and one number of blocks give the
    same blocks whatever the estimator, so that the draws of two estimators may be subtracted: a paired comparison
    (Künsch 1989 for blocks, Efron 1979 for the bootstrap).
    """
    blocks = len(sums.abs_error_n)
    chosen = np.random.default_rng(seed).integers(0, blocks, size=(repeats, blocks))
    return 100.0 * sums.abs_error_n[chosen].sum(axis=1) / sums.abs_friction_n[chosen].sum(axis=1)


def interval(draws: Array) -> tuple[float, float]:
    """Return the 95 % interval of draws, by percentiles."""
    low, high = np.quantile(draws, INTERVAL)
    return float(low), float(high)
