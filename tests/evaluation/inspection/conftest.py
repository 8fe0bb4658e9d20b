"""The fixtures of the inspection's tests."""

from inspected_recordings import labeller, strokes  # noqa: F401
