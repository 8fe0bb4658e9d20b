"""Figures as PNG: Figures 5 to 9 of the paper and further ones, drawn without a display."""
