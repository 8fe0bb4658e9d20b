"""Filters and differentiators, causal and zero-phase; every detection of motion."""
