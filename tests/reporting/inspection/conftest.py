"""The fixtures of the inspection's tests."""

from inspected_recordings import filters, labeller, strokes  # noqa: F401
