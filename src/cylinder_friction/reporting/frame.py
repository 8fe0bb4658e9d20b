"""A page's frame for other packages: its templates, tables, figures and colours.

These names are public: a page of another package that is made with them looks like the project's own.
"""

from cylinder_friction.reporting.page import NONE, Cell, Table, packed, page_html
from cylinder_friction.reporting.page_figure import PageFigure
from cylinder_friction.reporting.style import BLUE, BROWN, GREEN, INK, ORANGE, PALE, QUIET, SKY

__all__ = [
    "BLUE",
    "BROWN",
    "GREEN",
    "INK",
    "NONE",
    "ORANGE",
    "PALE",
    "QUIET",
    "SKY",
    "Cell",
    "PageFigure",
    "Table",
    "packed",
    "page_html",
]
