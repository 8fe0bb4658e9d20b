"""The golden model, for the peers of its step."""

from golden_fixtures import golden_model, hybrid, samples

__all__ = ["golden_model", "hybrid", "samples"]
