"""Contract suites and golden trajectories that any estimator can be tested with."""
