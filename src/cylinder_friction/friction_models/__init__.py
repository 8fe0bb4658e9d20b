"""Friction as a function of motion: analytical models, and their identification from labelled recordings."""
