"""Matplotlib's figures in the common look, with output that depends only on the data."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from cylinder_friction.reporting.style import GRID, INK, PALE, QUIET

if TYPE_CHECKING:
    from matplotlib.axes import Axes

STYLE: Any = {
    "font.family": "sans-serif",
    "font.size": 9.0,
    "text.color": INK,
    "axes.titlesize": 10.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 9.0,
    "axes.labelcolor": QUIET,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": PALE,
    "axes.grid": True,
    "axes.axisbelow": True,
    "xtick.color": PALE,
    "ytick.color": PALE,
    "xtick.labelcolor": QUIET,
    "ytick.labelcolor": QUIET,
    "grid.color": GRID,
    "grid.linewidth": 0.8,
    "legend.frameon": True,
    "legend.framealpha": 0.85,
    "legend.facecolor": "#ffffff",
    "legend.edgecolor": "none",
    "legend.fontsize": 8.5,
    "lines.linewidth": 1.2,
    "path.simplify": True,
    "path.simplify_threshold": 0.5,
    "svg.fonttype": "none",
    "svg.hashsalt": "cylinder-friction",
    "figure.constrained_layout.use": True,
    "savefig.dpi": 150,
}


class StyledFigure(Figure):
    """A figure without pyplot's global state, which notebooks show as it is."""

    def _repr_png_(self) -> bytes:
        return png_bytes(self)


def draw(build: Callable[..., Figure], *arguments: Any, **options: Any) -> Figure:
    """Call ``build(*arguments, **options)`` in the common style, whatever style the caller's Matplotlib has."""
    with mpl.rc_context({**mpl.rcParamsDefault, **STYLE}):
        return build(*arguments, **options)


def panels(
    rows: int, columns: int, width: float, height: float, heights: Sequence[float] | None = None
) -> tuple[Figure, list[Axes]]:
    """Make a figure of ``width`` by ``height`` inches, and its axes row by row.

    ``heights`` gives each row's share of the height; equal if it is None.
    """
    figure = StyledFigure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, columns, squeeze=False, height_ratios=heights)
    return figure, list(axes.ravel())


def grid_of(count: int, width: float, height: float) -> tuple[Figure, list[Axes]]:
    """Make a figure with ``count`` panels of ``width`` by ``height`` inches, two side by side."""
    columns = min(2, max(1, count))
    rows = -(-max(1, count) // columns)
    figure, axes = panels(rows, columns, width * columns, height * rows)
    for axis in axes[count:]:
        axis.set_visible(False)
    return figure, axes[:count]


def png_bytes(figure: Figure) -> bytes:
    """Write the figure as PNG; equal data give equal bytes."""
    return _saved(figure, format="png", metadata={"Software": None})


def svg_text(figure: Figure, name: str, words: str) -> str:
    """Write the figure as an SVG element that fills the width it is given; equal data give equal text.

    ``name`` makes identifiers within the element unique in the page; ``words`` state what it shows, for screen readers.
    """
    text = _saved(figure, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None}).decode()
    text = re.sub(r"(?s)^.*?<svg\b", "<svg", text)
    text = re.sub(r"(?s)\s*<metadata>.*?</metadata>", "", text)
    text = re.sub(r' (width|height)="[\d.]+pt"', "", text, count=2)
    text = re.sub(r' (xmlns(:\w+)?|version)="[^"]*"', "", text)
    text = text.replace("xlink:href", "href")
    text = re.sub(r'(\bid="|url\(#|href="#)', rf"\g<1>{name}-", text)
    text = re.sub(r' d="[^"]*"', lambda path: re.sub(r"(\d\.\d\d)\d+", r"\1", path[0]), text)
    escaped = words.replace("&", "&amp;").replace("<", "&lt;").replace('"', "&quot;")
    return text.replace("<svg", f'<svg role="img" aria-label="{escaped}"', 1)


def _saved(figure: Figure, **options: Any) -> bytes:
    buffer = io.BytesIO()
    with mpl.rc_context({**mpl.rcParamsDefault, **STYLE}):
        figure.savefig(buffer, **options)
    return buffer.getvalue()
