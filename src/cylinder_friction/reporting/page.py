"""The builder of all pages: templates, tables and figures become one HTML text that loads nothing from outside.

Figures are plain data for Plotly's library in the browser, in a common look.
"""

from __future__ import annotations

import base64
import json
import math
import re
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from importlib.resources import files
from typing import TYPE_CHECKING, Any, Self

import jinja2
import numpy as np
from markupsafe import Markup, escape
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.reporting.style import FONT, GRID, INK, PALE, SERIES
from cylinder_friction.wording import four_digits

if TYPE_CHECKING:
    from matplotlib.figure import Figure


_AXIS = {"gridcolor": GRID, "linecolor": PALE, "showline": True, "zeroline": False, "automargin": True}
WIDE_SPAN = 10.0
"""Ratio of speeds from which the axis has fewer ticks."""
_LEGEND = {
    "orientation": "h",
    "yref": "container",
    "yanchor": "top",
    "xref": "container",
    "x": 0.0,
    "itemsizing": "constant",
}
TOOLBAR = 24
"""Height of Plotly's toolbar, for which the top of each figure is free, so that it covers no legend [pixels]."""
LINE_POINTS = 2400
PANEL_HEIGHT = 165
PLOTTED = 12
"""Most recordings with figures on a page that holds its figures unpacked."""


class PageFigure:
    """Panels side by side, or one below the other with a common axis, and their traces.

    ``shares`` are the panels' shares of the width, or of the height if ``below`` is true; ``gap`` lies between two.

    Attributes:
        data: The traces, in Plotly's form; ``layout`` holds everything else.
    """

    def __init__(
        self, shares: Sequence[float] = (1.0,), gap: float = 0.1, below: bool = False, titles: Sequence[str] = ()
    ) -> None:
        self.data: list[dict[str, Any]] = []
        self.layout: dict[str, Any] = {"annotations": [], "shapes": []}
        self.panels = len(shares)
        width = (1.0 - gap * (self.panels - 1)) / sum(shares)
        for number, share in enumerate(shares, start=1):
            start = sum(shares[: number - 1]) * width + (number - 1) * gap
            ends = [start, start + share * width]
            x, y = ([0.0, 1.0], [1.0 - ends[1], 1.0 - ends[0]]) if below else (ends, [0.0, 1.0])
            self.layout[f"xaxis{_of(number)}"] = {"domain": x, "anchor": f"y{_of(number)}", "ticks": "outside"}
            self.layout[f"xaxis{_of(number)}"] |= {"tickcolor": PALE, **_AXIS}
            self.layout[f"yaxis{_of(number)}"] = {"domain": y, "anchor": f"x{_of(number)}", **_AXIS}
            if below and number < self.panels:
                self.x_axis(number, matches=f"x{_of(self.panels)}", showticklabels=False)
        for number, title in enumerate(titles, start=1):
            ends = self.layout[f"xaxis{_of(number)}"]["domain"]
            self.note(title, xref="paper", x=sum(ends) / 2.0, yref="paper", y=1.0, xanchor="center", yanchor="bottom")

    @classmethod
    def of(cls, figure: Any) -> Self:
        """Convert a figure of Plotly's own library, without its look."""
        drawn, plain = cls(), json.loads(figure.to_json())
        own = {name: value for name, value in plain["layout"].items() if name not in ("template", "title")}
        drawn.data, drawn.layout = plain["data"], {"annotations": [], **own}
        for name in [each for each in own if each[1:].startswith("axis")]:
            drawn.layout[name] |= {"ticks": "outside", "tickcolor": PALE, **_AXIS} if name[0] == "x" else _AXIS
        return drawn

    def add(self, panel: int = 1, **trace: Any) -> None:
        """Add a scatter trace to a panel."""
        self.data.append({"type": "scatter", **trace, "xaxis": f"x{_of(panel)}", "yaxis": f"y{_of(panel)}"})

    def shows(self, name: str) -> bool:
        """Check whether the figure has a trace of this name."""
        return any(trace.get("name") == name for trace in self.data)

    def x_axis(self, panel: int = 1, title: str = "", **settings: Any) -> None:
        """Set title and settings of a panel's x axis."""
        self._axis("x", panel, title, settings)

    def y_axis(self, panel: int = 1, title: str = "", **settings: Any) -> None:
        """Set title and settings of a panel's y axis."""
        self._axis("y", panel, title, settings)

    def note(self, text: str, **place: Any) -> None:
        """Add words at a position."""
        self.layout["annotations"].append({"text": text, "showarrow": False, "font": {"size": 13}, **place})

    def upright(self, x: Any, line: Mapping[str, Any], across: str = "y domain") -> None:
        """Add a line from bottom to top of the first panel, or of all panels if ``across`` is ``paper``."""
        ends = {"x0": x, "x1": x, "xref": "x", "y0": 0, "y1": 1, "yref": across}
        self.layout["shapes"].append({"type": "line", **ends, "line": dict(line)})

    def look(self, height: int, legend_rows: int = 1, **layout: Any) -> Self:
        """Give this figure the common look; the toolbar and ``legend_rows`` are kept free above it."""
        height += TOOLBAR
        self.layout |= {
            "height": height,
            "font": {"family": FONT, "size": 13, "color": INK},
            "margin": {"l": 62, "r": 16, "t": 22 + TOOLBAR + 20 * legend_rows, "b": 48},
            "legend": {**_LEGEND, "y": 1.0 - TOOLBAR / height},
            "hoverlabel": {"font": {"family": FONT}},
            "plot_bgcolor": "rgba(0,0,0,0)",
            "paper_bgcolor": "rgba(0,0,0,0)",
            "colorway": list(SERIES),
            **layout,
        }
        return self

    def to_json(self) -> str:
        """Write the figure as JSON that cannot end the script element around it."""
        figure = {"data": self.data, "layout": self.layout}
        text = json.dumps(figure, separators=(",", ":"), default=_packed, allow_nan=False, ensure_ascii=False)
        return text.replace("<", "\\u003c")

    def _axis(self, which: str, panel: int, title: str, settings: Mapping[str, Any]) -> None:
        named = {"title": {"text": title}} if title else {}
        self.layout[f"{which}axis{_of(panel)}"] |= {**named, **settings}


def speed_ticks(velocities_m_s: Sequence[float]) -> list[float]:
    """Choose the ticks of a logarithmic axis of speeds [mm/s], so that a narrow span has several."""
    speeds = [abs(each) for each in velocities_m_s] or [1.0]
    steps = (1, 2, 5) if max(speeds) >= WIDE_SPAN * min(speeds) else (1, 2, 3, 4, 5, 6, 8)
    return [step * 10.0**power for power in range(-3, 5) for step in steps]


def compact(values: Array) -> Array:
    """Round values to a thousandth of their span or better, finer than a pixel, so that they deflate well.

    The results are multiples of a power of two, so that they end in zeros in the page's single precision.
    """
    known = values[np.isfinite(values)]
    span = float(np.ptp(known)) if len(known) else 0.0
    step = 2.0 ** math.floor(math.log2(span / 1000.0)) if span > 0.0 else 2.0**-20
    return step * np.round(values / step)


def _of(panel: int) -> str:
    return "" if panel == 1 else str(panel)


def _packed(values: Any) -> Any:
    """Pack an array as bytes in single precision, which is finer than a pixel.

    The first bytes of all numbers come first, then the second ones, and so on, which deflates better and faster;
    ``page.js`` restores the order.
    """
    if not isinstance(values, np.ndarray) or values.ndim != 1:
        return values.item() if isinstance(values, np.generic) else values.tolist()
    planes = values.astype("<f4").view(np.uint8).reshape(-1, 4).T
    return {"planes": base64.b64encode(planes.tobytes()).decode()}


@dataclass(frozen=True)
class Line:
    """One line of a panel; its name is in the legend unless ``in_legend`` is false."""

    name: str
    values: Array
    colour: str
    width: float = 1.2
    in_legend: bool = True


@dataclass(frozen=True)
class Panel:
    """Lines that share an axis, the axis's title with its unit, and the panel's share of the height."""

    axis: str
    lines: Sequence[Line]
    share: float = 1.0


def over_time(time_s: Array, panels: Sequence[Panel], legend_rows: int = 1, points: int = LINE_POINTS) -> PageFigure:
    """Draw the figure over evenly spaced times; lines of more than ``points`` samples keep only their extremes."""
    shares = [panel.share for panel in panels]
    figure = PageFigure(shares, 0.14 / len(panels), below=True)
    step_s = float(time_s[-1] - time_s[0]) / max(1, len(time_s) - 1)
    for row, panel in enumerate(panels, start=1):
        for line in panel.lines:
            values, samples = extremes(line.values, points)
            figure.add(
                row,
                x0=float(time_s[0]),
                dx=samples * step_s,
                y=compact(values),
                mode="lines",
                name=line.name,
                legendgroup=line.name,
                showlegend=line.in_legend,
                line={"color": line.colour, "width": line.width},
                hovertemplate="%{y:.4~g}",
            )
        figure.y_axis(row, panel.axis)
    figure.x_axis(len(panels), "time [s]")
    return figure.look(round(PANEL_HEIGHT * sum(shares)) + 110, legend_rows, hovermode="x")


def extremes(values: Array, points: int) -> tuple[Array, float]:
    """Find the least and the greatest value of every stretch in their order, and for how many samples each stands.

    A line through them looks like the line through all samples, with all peaks. Values that are not finite are chosen
    only in a stretch without others.

    Args:
        values: Values of shape ``(n,)``; returned unchanged if there are at most ``points``.
        points: Most values to return, at least 2.
    """
    if len(values) <= points:
        return values, 1.0
    stretch = -(-len(values) // (points // 2))
    table = np.append(values, np.full(-len(values) % stretch, np.nan)).reshape(-1, stretch)
    low = high = table
    if not (known := np.isfinite(table)).all():
        low, high = np.where(known, table, np.inf), np.where(known, table, -np.inf)
    least, greatest = np.argmin(low, axis=1), np.argmax(high, axis=1)
    both = np.stack([np.minimum(least, greatest), np.maximum(least, greatest)], axis=1)
    return table[np.arange(len(table))[:, None], both].ravel(), 0.5 * stretch


def spread_evenly(rows: NDArray[np.intp], points: int) -> NDArray[np.intp]:
    """Choose at most ``points`` of ``rows``, evenly spaced: for clouds of points, in which no row is special."""
    if len(rows) <= points:
        return rows
    return rows[np.linspace(0, len(rows) - 1, points).round().astype(np.intp)]


_DRAWN: list[str] = []
"""Captions of the pictures of the page in progress; their number makes identifiers unique."""


@dataclass(frozen=True)
class Cell:
    """One cell of a table."""

    words: str  # Its text
    small: str = ""  # A second line, smaller
    value: float | None = None  # Sort key within its column; None for words
    shade: float | None = None  # -1 is full blue (good), 1 full orange (bad), 0 white; None leaves the background alone
    style: str = ""  # CSS classes
    tip: str = ""  # Shown below the mouse
    link: str = ""  # Address that the words lead to
    badge: bool = False  # Whether the words are an outcome, on a coloured ground
    more: Sequence[str] = ()  # Further lines, folded

    @property
    def finite(self) -> bool:
        return self.value is not None and math.isfinite(self.value)


NONE = Cell("–", style="none")
"""Cell of an unknown value."""


def number_cell(value: float | None, digits: str = "z.0f") -> Cell:
    """Render a number as a cell that its column is sorted by; ``NONE`` if it is not finite."""
    return NONE if value is None or not math.isfinite(value) else Cell(f"{value:{digits}}", value=value)


@dataclass(frozen=True)
class Table:
    """A table: rows of cells below a head."""

    head: Sequence[str | Cell]  # Heads of the columns
    rows: Sequence[Sequence[str | Cell]]  # One cell, or plain text, per column
    words: Sequence[int] = ()  # Columns of text, left-aligned; the others hold numbers. The first column is always text
    groups: Sequence[tuple[str, int]] = ()  # Common heads above the others, with their numbers of columns
    style: str = ""  # CSS classes of the table
    sortable: bool = False  # Whether a click on the head sorts by that column
    outcomes: Sequence[str] = ()  # Outcome of each row, for the filter buttons; empty without these

    @classmethod
    def of(cls, items: Iterable[Any], columns: Mapping[str | Cell, Callable[[Any], str | Cell]], **look: Any) -> Table:
        """Make a table with one row per item, from each column's head and function of an item, and more fields."""
        return cls(tuple(columns), [tuple(show(item) for show in columns.values()) for item in items], **look)

    @property
    def classes(self) -> str:
        return f"{self.style} sortable".strip() if self.sortable else self.style

    @cached_property
    def head_cells(self) -> list[Cell]:
        return self._cells(self.head)

    @cached_property
    def cells(self) -> list[list[Cell]]:
        return [self._cells(row) for row in self.rows]

    def _cells(self, row: Sequence[str | Cell]) -> list[Cell]:
        return [
            each if isinstance(each, Cell) else Cell(each, style="words" if column in self.words else "")
            for column, each in enumerate(row)
        ]

    def markdown(self) -> str:
        """Write the table as Markdown; the best cells are bold."""

        def line(row: Sequence[Cell]) -> str:
            words = [f"{cell.words} {cell.small}".rstrip() for cell in row]
            words = [f"**{each}**" if "best" in cell.style else each for each, cell in zip(words, row, strict=True)]
            return "| " + " | ".join(each.replace("|", "\\|") for each in words) + " |"

        rule = "|---|" + "---:|" * (len(self.head) - 1)
        return "\n".join([line(self.head_cells), rule, *(line(row) for row in self.cells)]) + "\n"


def page_html(template: str, package: str = __package__, **context: Any) -> str:
    """Render a page.

    The template is a path in the package, ``templates/...``, and may use templates of ``templates/frame`` here. The
    context contains at least ``title``.
    """
    _DRAWN.clear()
    return _environment(package).get_template(template).render(context)


@cache
def _environment(package: str) -> jinja2.Environment:
    loaders = [jinja2.PackageLoader(package, ""), jinja2.PackageLoader(__package__, "templates/frame")]
    environment = jinja2.Environment(
        loader=jinja2.ChoiceLoader(loaders),
        autoescape=True,
        auto_reload=False,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
    )
    environment.filters |= {"svg": _svg, "data": _data, "breakable": _breakable, "digits": four_digits}
    environment.globals |= {"static": static}
    return environment


def _svg(figure: Figure, words: str) -> Markup:
    from cylinder_friction.reporting.print_figure import svg_text  # most pages need no Matplotlib

    _DRAWN.append(words)
    return Markup(svg_text(figure, f"figure{len(_DRAWN)}", words))  # noqa: S704 - drawn by Matplotlib, which escapes


def packed(html: str, level: int = 9) -> str:
    """Pack a part of a page as text that ``page.js`` unpacks once its section is chosen: deflated, in base64."""
    return base64.b64encode(zlib.compress(html.encode(), level)).decode()


def static(name: str) -> Markup:
    """Read a file of the folder ``static``, unchanged."""
    return Markup((files(__package__) / "static" / name).read_text(encoding="utf-8"))  # noqa: S704 - our own file


def _data(figure: PageFigure) -> Markup:
    return Markup(figure.to_json())  # noqa: S704 - it cannot end its script element


def _breakable(words: str) -> Markup:
    """Allow line breaks behind the separators of a path."""
    return Markup(re.sub(r"(?<=\w)([/_-])(?=\w)", r"\1<wbr>", str(escape(words))))  # noqa: S704
