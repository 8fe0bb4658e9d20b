"""Indicators of sessions, their trends, and the assessment of a cylinder."""
