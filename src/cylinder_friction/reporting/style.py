"""The common look of figures and pages: colours, marks and fonts."""

BLUE, ORANGE, GREEN, PINK, BROWN = "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#7A5A00"
SKY, YELLOW = "#56B4E9", "#E69F00"
"""The colour-blind-safe palette of Okabe and Ito (2008)."""
BLACK, INK, QUIET, GRID, PALE = "#000000", "#1d2733", "#5b6876", "#E3E8ED", "#A6ADB4"
SERIES = (BLUE, ORANGE, GREEN, PINK, BROWN, SKY, YELLOW, INK)

CONDITION_MARKS = (
    (BLUE, "o", "circle"),
    (ORANGE, "s", "square"),
    (GREEN, "^", "triangle-up"),
    (PINK, "D", "diamond"),
    (BROWN, "v", "triangle-down"),
    (SKY, "P", "cross"),
)
"""Colour, Matplotlib marker and Plotly symbol of each operating condition, in order; they repeat if there are more."""
FONT = "system-ui, Segoe UI, Roboto, DejaVu Sans, sans-serif"
