"""The frame of pages for other packages: templates, tables, figures and colours.

These names are public: pages that other packages make with them look like the project's own.
"""

from cylinder_friction.reporting.page import NONE, Cell, PageFigure, Table, packed, page_html
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
