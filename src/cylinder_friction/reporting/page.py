"""The builder of all pages: templates, tables and figures become one HTML text that loads nothing from outside."""

from __future__ import annotations

import base64
import math
import re
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import jinja2
from markupsafe import Markup, escape

from cylinder_friction.wording import four_digits

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from cylinder_friction.reporting.page_figure import PageFigure


PLOTTED = 12
"""Most recordings with figures on a page that holds its figures unpacked."""
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


def number_cell(value: float | None, digits: str = ".0f") -> Cell:
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
