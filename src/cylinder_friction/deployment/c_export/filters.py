"""C source of the filter bank: features, base force and velocity from the last raw samples.

In double precision sums run in the order of ``signals.causal.FirFilter``, so that not one bit differs. In single
precision each row filters differences from the newest sample, which are exact where samples are close, so that a
velocity does not drown in the rounding of a position. Equal rows are computed once, zeros at a row's ends not at all.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.deployment.c_export.literals import number, numbers

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cylinder_friction.deployment.c_export.literals import Type
    from cylinder_friction.realtime.model import StepModel

    Array = NDArray[np.float64]

LIMIT_OPERATIONS = 3
ROUNDING = 1e-9
"""Taps whose sum is smaller take no part of a constant: derivatives."""


@dataclass(frozen=True)
class FilterBank:
    """The distinct rows of all filters of a model.

    Attributes:
        rows: Shape ``(rows, 3, lags)``.
        feature: Which row each feature takes.
        base: Which row the base force is; None where there is none.
        velocity: Which row the velocity is.
    """

    rows: Array
    feature: tuple[int, ...]
    base: int | None
    velocity: int

    @property
    def lags(self) -> int:
        return int(self.rows.shape[2])

    def operations(self) -> int:
        """Return the multiply-adds of one step."""
        return sum(last - first for row in self.rows for first, last in filter(None, map(_extent, row)))


def filter_bank(model: StepModel) -> FilterBank:
    """Return the model's filters, each distinct one once."""
    lags = max(taps.shape[-1] for taps in (model.feature_taps, model.base_taps, model.velocity_taps))
    every = [*model.feature_taps, model.velocity_taps, model.base_taps]
    rows: list[Array] = []
    chosen = []
    for taps in every:
        row = np.pad(taps, ((0, 0), (0, lags - taps.shape[1])))
        same = [index for index, other in enumerate(rows) if np.array_equal(row, other)]
        if not same:
            rows.append(row)
        chosen.append(same[0] if same else len(rows) - 1)
    has_base = bool(np.any(model.base_taps))
    if not has_base and chosen[-1] == len(rows) - 1 and chosen.count(chosen[-1]) == 1:
        rows.pop()
    longest = max((extent[1] for row in rows for extent in map(_extent, row) if extent is not None), default=1)
    stacked = np.stack(rows)[:, :, :longest]
    return FilterBank(stacked, tuple(chosen[:-2]), chosen[-1] if has_base else None, chosen[-2])


def filter_source(bank: FilterBank, kind: Type) -> str:
    """Return the taps and ``filter_samples``, which fills ``filtered[ROWS]`` from the ring of samples."""
    taps, lines, start = [], [], 0
    for index, row in enumerate(bank.rows):
        terms = []
        for channel, extent in enumerate(map(_extent, row)):
            if extent is None:
                continue
            first, last = extent
            terms.append(_Term(start, channel, first, last - first, float(row[channel].sum())))
            taps.extend(row[channel, first:last])
            start += last - first
        lines.extend(_row_source(index, terms, kind))
    return f"""\
/* Filters on the last samples. A window holds the newest sample first. */
#define ROWS {len(bank.rows)}

static const real TAPS[{max(len(taps), 1)}] = {{
{numbers(taps or [0.0], kind)}
}};

{_WEIGHTED_DIFFERENCES if kind == "float" else _WEIGHTED}
static void filter_samples(const real *p1, const real *p2, const real *x, real filtered[ROWS])
{{
    const real *const window[3] = {{p1, p2, x}};
{chr(10).join(lines)}
}}
"""


@dataclass(frozen=True)
class _Term:
    """One channel of a row: where its taps begin, the lags they cover, and their sum."""

    start: int
    channel: int
    first: int
    count: int
    sum: float


def _row_source(index: int, terms: list[_Term], kind: Type) -> list[str]:
    total, lines = number(0.0, kind), []
    for term in terms:
        begin = total
        if kind == "float" and abs(term.sum) > ROUNDING:
            begin = f"{total} + {number(term.sum, kind)} * window[{term.channel}][0]"
        newest = f", window[{term.channel}][0]" if kind == "float" else ""
        window = f"window[{term.channel}] + {term.first}"
        lines.append(f"    filtered[{index}] = weighted({begin}, TAPS + {term.start}, {window}, {term.count}{newest});")
        total = f"filtered[{index}]"
    return lines or [f"    filtered[{index}] = {total};"]


def feature_source(model: StepModel, bank: FilterBank, kind: Type) -> str:
    """Return ``make_features``: soft limit and standardisation of each feature, written into ``features``."""
    lines = []
    for index, row in enumerate(bank.feature):
        limit = float(model.feature_limits[index])
        value = f"filtered[{row}]"
        if limit > 0.0:
            magnitude = "fabsf" if kind == "float" else "fabs"
            value = f"{value} / ({magnitude}({value}) + {number(limit, kind)})"
        mean, scale = number(model.feature_mean[index], kind), number(model.feature_scale[index], kind)
        lines.append(f"    features[{index}] = (float)(({value} - {mean}) / {scale});")
    body = "\n".join(lines)
    return f"""\
static void make_features(const real filtered[ROWS], float features[FEATURES])
{{
{body}
}}
"""


def _extent(taps: Array) -> tuple[int, int] | None:
    """Return the first lag and one past the last lag that count; None where none does."""
    used = np.flatnonzero(taps)
    return None if len(used) == 0 else (int(used[0]), int(used[-1]) + 1)


_WEIGHTED = """\
static real weighted(real total, const real *taps, const real *window, int count)
{
    int lag;
    for (lag = 0; lag < count; ++lag) {
        total += taps[lag] * window[lag];
    }
    return total;
}
"""

_WEIGHTED_DIFFERENCES = """\
/* Differences from the newest sample are exact where samples are close: derivatives lose nothing to rounding. */
static real weighted(real total, const real *taps, const real *window, int count, real newest)
{
    int lag;
    for (lag = 0; lag < count; ++lag) {
        total += taps[lag] * (window[lag] - newest);
    }
    return total;
}
"""
