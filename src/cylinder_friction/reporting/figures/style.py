"""One look for every figure, and PNG bytes that depend on nothing but the data."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from matplotlib.axes import Axes

STYLE: Any = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.titlesize": 10.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#555555",
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#E4E4E4",
    "grid.linewidth": 0.7,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "lines.linewidth": 1.2,
    "path.simplify": True,
    "figure.constrained_layout.use": True,
    "savefig.dpi": 150,
}


def draw(build: Callable[..., Figure], *arguments: Any) -> Figure:
    """Return ``build(*arguments)`` in the shared style, whatever style the caller's matplotlib has."""
    with mpl.rc_context({**mpl.rcParamsDefault, **STYLE}):
        return build(*arguments)


def panels(
    rows: int, columns: int, width: float, height: float, heights: Sequence[float] | None = None
) -> tuple[Figure, list[Axes]]:
    """Return a figure of ``width`` by ``height`` inches without pyplot's global state, and its axes row by row.

    ``heights`` gives each row's share of the height; equal where it is None.
    """
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, columns, squeeze=False, height_ratios=heights)
    return figure, list(axes.ravel())


def png_bytes(figure: Figure) -> bytes:
    """Return the figure as PNG; equal data give equal bytes."""
    buffer = io.BytesIO()
    with mpl.rc_context({**mpl.rcParamsDefault, **STYLE}):
        figure.savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()
