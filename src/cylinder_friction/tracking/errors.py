"""What tracking refuses; importable without MLflow."""

from __future__ import annotations


class TrackingError(RuntimeError):
    """The tracking store could not be reached, or what is to be logged is not what was recorded."""


class LineageError(TrackingError):
    """The way back from a model cannot be written down or followed; the message names what is missing."""
