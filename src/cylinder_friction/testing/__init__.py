"""Contract suites and golden trajectories that any estimator or friction model can be tested with."""
