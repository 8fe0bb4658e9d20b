"""One step of an estimator in real time: what it needs, how it is guarded, and the step itself."""
