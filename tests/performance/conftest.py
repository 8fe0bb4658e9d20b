"""The golden hybrid and a LuGre, whose steps are measured, and samples to step them through."""

from golden_fixtures import golden_model, hybrid, lugre, samples

__all__ = ["golden_model", "hybrid", "lugre", "samples"]
