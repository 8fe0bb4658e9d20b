"""The step of an estimator, once in Python: packed model, guard, bounds, flags, stream."""
