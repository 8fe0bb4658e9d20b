"""Figures as PNG: Figures 5 to 9 of the paper and further ones, drawn without a display."""

from cylinder_friction.evaluation.figures.all_figures import all_figures
from cylinder_friction.evaluation.figures.style import draw, png_bytes

__all__ = ["all_figures", "draw", "png_bytes"]
