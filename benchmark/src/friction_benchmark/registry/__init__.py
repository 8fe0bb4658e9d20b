"""The models that the benchmark compares: one module per estimator, so that a change concerns its own models alone."""
