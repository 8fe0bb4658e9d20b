"""What all figures of the inspection share: colours, fonts, and how many points they may have."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import plotly.graph_objects as go
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

PISTON_SIDE, ROD_SIDE = "#D55E00", "#0072B2"
EXTENDING, RETRACTING, AT_REST = "#0072B2", "#D55E00", "#9AA4AF"
INK, QUIET, GREEN = "#1d2733", "#5b6876", "#00795C"
FILTER_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#7A5A00", "#56B4E9", "#E69F00", "#1d2733")

LINE_POINTS = 2400
CLOUD_POINTS = 3000

PA_PER_BAR = 1e5
MM_PER_M = 1e3


def single(values: Array) -> NDArray[np.float32]:
    """Return values in single precision, which halves the page and is finer than a pixel."""
    return np.asarray(values, dtype=np.float32)


def finish(figure: go.Figure, height: int, legend_rows: int = 1) -> go.Figure:
    """Return the figure in the page's look."""
    figure.update_layout(
        template="simple_white",
        height=height,
        font={"family": "system-ui, Segoe UI, Roboto, DejaVu Sans, sans-serif", "size": 13, "color": INK},
        margin={"l": 70, "r": 20, "t": 44 + 20 * legend_rows, "b": 50},
        legend={
            "orientation": "h",
            "yref": "container",
            "y": 1.0,
            "yanchor": "top",
            "x": 0.0,
            "itemsizing": "constant",
        },
        modebar={"orientation": "v"},
    )
    figure.update_annotations(font_size=13)
    figure.update_xaxes(showgrid=True, gridcolor="#E8ECF0", automargin=True)
    return figure.update_yaxes(showgrid=True, gridcolor="#E8ECF0", automargin=True, zeroline=False)
