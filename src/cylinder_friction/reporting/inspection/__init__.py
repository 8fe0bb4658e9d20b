"""Inspection of recordings: checks as text, signals and friction as a page, and a first mapping of a new file."""
